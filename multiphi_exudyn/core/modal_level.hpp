// Modal level: the modes of a set of closed contacts and what follows from them, whatever the gaps and loads are.
//
//     x = Psi eta + x_inf                                                               (38.2, 38.4)
//     eta'' + D eta' + diag(omega^2) eta = Psi^T (f - f_static),   D = Psi^T C_l Psi    (38.3)
//
// Where no closed contact resists a rigid-body motion, omega = 0. The total stiffness of a force law may be negative,
// and the level indefinite: then omega^2 < 0, the square of a rate of growth (eta ~ exp(+-|omega| t)). Every direction of
// positive stiffness interlaces, omega_i(open) <= omega_i(level) <= omega_i+c(open), one of negative stiffness
// downwards; asserted here. Friction of sliding contacts is added to it in sliding.hpp.
#pragma once

#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base.hpp"
#include "closed_directions.hpp"
#include "linear_algebra.hpp"
#include "static_response.hpp"

namespace multiphi {

// Measured frequencies and damping ratios in place of those of a level's lowest modes.
struct Measured {
    std::optional<Vector> frequencies;  // [Hz]
    std::optional<Vector> ratios;
};

// Which modes the levels of a model keep, all of them at most; modes of one frequency are kept together.
struct KeptModes {
    int most = std::numeric_limits<int>::max();
    double highest = std::numeric_limits<double>::infinity();  // frequency [Hz]; one mode is kept at least
    std::map<std::vector<int>, Measured> measured;             // by the closed links of levels
};

// Static response of a level to gaps and a static load, x_inf of eq. (38.4).
struct Asymptotic {
    Vector configuration;  // y_inf (m,)
    Vector gaps;           // of all links at y_inf (l,) [m], zero where they are round-off
    Vector forces;         // lambda of the closed links (k,) [N]
    Vector drive;          // force (r,) on the zero-frequency modes, zero on the others
    Vector load;           // (m,)
    double strain = 0.0;   // energy of y_inf [J]
};

struct ResidualBoundary;

class ModalLevel {
  public:
    // closed: numbers of links, ascending. Throws LevelFailure where there is no such level.
    ModalLevel(const Base& base, std::vector<int> closed, const KeptModes& kept);
    // With these residual links closed beside those of the boundary's host, in the space of its modes.
    ModalLevel(const ResidualBoundary& boundary, const std::vector<int>& acting);

    const Base& base() const { return *base_; }
    const std::vector<int>& links() const { return directions_.closed(); }  // closed ones
    const ClosedDirections& directions() const { return directions_; }
    int modes() const { return static_cast<int>(squares.size()); }
    int kept_beyond() const { return kept_beyond_; }  // number of modes that complete a cluster beyond the wanted ones
    bool vibrates() const { return vibrates_; }       // no mode has zero frequency
    bool has_neutral_modes() const { return neutral_.rows() > 0; }

    Asymptotic asymptotic(const Vector& load, const Vector& gaps) const;  // gaps (l,) of all links at y = 0
    Deflection deflection(const Vector& load, const Vector& gaps) const;  // gaps (k,) of the closed links
    // The force (r,) that `deflection` leaves on zero-frequency modes, zero on the others.
    Vector driving_force(const Vector& load, const Vector& gaps) const;

    // The response to a load (m,) without the part in the level's modes, as of the modes left out.
    Deflection beside_modes(const Vector& load) const;

    // Puts zeros in place of round-off in a damping matrix (r, r) of zero-frequency modes: it would damp a mode that has
    // no other damping.
    void drop_damping_of_free_modes(Matrix& damping) const;

    // For each spring, by the first link of its direction, the part of its flexibility that is not in the first `count`
    // modes, and those that complete their last cluster.
    std::map<int, double> static_shares(int count) const;
    // The names of the closed links, in messages.
    std::string closed_names() const;

    Vector squares;              // omega^2 (r,) [rad2/s2], ascending, negative for growing modes, and
    Vector computed;             //   as computed from M and K: `squares` may be measured
    Matrix shapes;               // Psi (m, r), of which
    Matrix inertial;             //   this part has inertia: all of it, but for residual contacts
    Matrix damping;              // D (r, r)
    Matrix gaps;                 // of all links (l, r) from eta
    Matrix forces, force_rates;  // of closed links (k, r) from eta and eta'
    std::vector<bool> following;  // links (l,) whose gaps the closed rigid ones alone determine

  private:
    struct Response {
        Vector along, configuration, unbalanced;  // unbalanced: (m,) force that acts on zero-frequency modes
    };
    Response response(const Vector& load, const Vector& gaps) const;
    Response neutral_response(const Vector& load, const Vector& offsets) const;
    void measure(const Measured& measured);

    const Base* base_;
    ClosedDirections directions_;
    StaticResponse static_response_;
    Matrix neutral_;  // (z, m) zero-frequency modes if negative springs cancel the stiffness of a mode, else none
    int kept_beyond_ = 0;
    bool vibrates_ = true;
};

}  // namespace multiphi
