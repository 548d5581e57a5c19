// Sliding: friction proportional to the normal forces of closed contacts, in the modes without friction.
//
// Where contacts o slide, a force lambda_o acts along f_o = h_o - s mu h_t,o in place of h_o. With U = f - h and the
// level of the same closed contacts without friction (omega^2, modes Psi, forces lambda = L eta + L' eta'),
//
//     eta'' + (D - Psi^T U L'_o) eta' + (omega^2 - Psi^T U L_o) eta = p                   (38.3)
//
// The matrices are not symmetric, and the motion may grow: flutter. Energies are those of the symmetric level. Friction
// changes the reaction of a rigid contact: the truncated modes respond statically to U lambda_o, with the reactions
// W lambda_o,
//
//     lambda_o = L_o eta + L'_o eta' + W_o lambda_o
//
// With all modes I - W_o is h.M^-1 f / (h.M^-1 h). Motion exists and is unique where all its principal minors are
// positive. The static response is that of the symmetric level under the load and U lambda_o.
// Source: A. Klarbring, Examples of non-uniqueness and non-existence of solutions to quasistatic contact problems with
// friction, Ing. Archiv 60 (1990); on Painleve's rod F. Genot, B. Brogliato, New results on Painleve paradoxes, Eur. J.
// Mech. A/Solids 18 (1999).
#pragma once

#include <optional>
#include <vector>

#include "linear_algebra.hpp"
#include "modal_level.hpp"

namespace multiphi {

class Sliding {
  public:
    // Of a level in which contacts slide; throws LevelFailure where its motion is not unique.
    Sliding(const ModalLevel& level, std::vector<int> places);

    const std::vector<int>& places() const { return places_; }  // of the sliding contacts among the closed links
    const Matrix& pulled() const { return pulled_; }            // Psi^T U (r, o)
    const Matrix& coupling() const { return coupling_; }        // -Psi^T U L_o (r, r)
    const Matrix& damping() const { return damping_; }          // -Psi^T U L'_o (r, r), without round-off of free modes
    const Matrix& forces() const { return forces_; }            // of closed links (k, r) from eta, and
    const Matrix& force_rates() const { return force_rates_; }  //   from eta', with friction

    // Forces (k, n) of the closed links with friction, from those without.
    Matrix answered(const Matrix& forces) const;

    // As of the level without friction.
    Asymptotic asymptotic(const Vector& load, const Vector& gaps) const;  // gaps (l,) of all links at y = 0
    Deflection deflection(const Vector& load, const Vector& gaps) const;
    Vector driving_force(const Vector& load, const Vector& gaps) const;

  private:
    Matrix static_reactions() const;
    void check_unique_motion() const;
    // U lambda_o (m,) of the static response, from the forces (k,) without friction.
    Vector friction(const Vector& forces) const;

    const ModalLevel* level_;
    std::vector<int> places_;
    Matrix added_;      // U^T (o, m)
    Matrix reactions_;  // W (k, o)
    Matrix pulled_, coupling_, damping_, forces_, force_rates_;
};

// A level as it moves: without friction, or with that of sliding contacts.
struct MovingLevel {
    ModalLevel modal;
    std::optional<Sliding> sliding;

    MovingLevel(const Base& base, std::vector<int> closed, const KeptModes& kept);
    MovingLevel(const ResidualBoundary& boundary, const std::vector<int>& acting);
    MovingLevel(const MovingLevel&) = delete;

    const Matrix& forces() const { return sliding ? sliding->forces() : modal.forces; }
    const Matrix& force_rates() const { return sliding ? sliding->force_rates() : modal.force_rates; }
    Matrix coupling() const;        // S - diag(omega^2) (r, r),
    Matrix damping_matrix() const;  //   and D with what friction adds
    Asymptotic asymptotic(const Vector& load, const Vector& gaps) const;  // gaps (l,) of all links at y = 0
    Deflection deflection(const Vector& load, const Vector& gaps) const;
    Vector driving_force(const Vector& load, const Vector& gaps) const;

  private:
    void slide();
};

}  // namespace multiphi
