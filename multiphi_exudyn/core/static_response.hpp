// Static response: contact forces and configuration under a load and gaps, in base coordinates (38.5, with f_static).
//
//     y_e = Omega_e^-2 (f_e + P_e f),   f + K (p.y + gap) = 0  (rigid: p.y = -gap),   P_0 f + f_0 = 0
//
// P the closed directions, f (d,) the forces along them; e elastic, 0 rigid-body coordinates. With resisted rigid-body
// motions B z the forces and z (c,) solve
//
//     [ P_e^T Omega_e^-2 P_e + 1/K   P_0^T B ] [f]     [ -gap - P_e^T Omega_e^-2 f_e ]
//     [ B^T P_0                         0    ] [z]  =  [ -B^T f_0                    ]
//
// The solution is corrected until it holds: round-off of y is magnified by soft modes, that of f by a direction that
// hardly bends. What a correction takes back is round-off and becomes zero.
#pragma once

#include <vector>

#include "base.hpp"
#include "closed_directions.hpp"
#include "decompositions.hpp"
#include "linear_algebra.hpp"

namespace multiphi {

struct StaticSolution {
    Vector along;          // f (d,) along the vectors of the closed directions
    Vector configuration;  // y (m,), without motion that nothing resists
};

// Response of closed links, their forces by number.
struct Deflection {
    Vector forces;         // lambda (k,) [N]
    Vector configuration;  // y (m,)
};

class StaticResponse {
  public:
    StaticResponse(const Base& base, const ClosedDirections& directions);

    // The response to a load (m,) and to offsets (d,) of the directions, of the base and directions given before.
    StaticSolution solution(const ClosedDirections& directions, const Vector& load, const Vector& offsets) const;

    // Number of rigid-body motions that the closed directions resist.
    int resisted() const { return static_cast<int>(resisted_.cols()); }

  private:
    void make_solver(const ClosedDirections& directions);
    Vector sizes_of_unknowns(const ClosedDirections& directions) const;
    // (f, z) (d + c,) of right sides (d,) and (c,).
    Vector unknowns(const Vector& of_directions, const Vector& of_motions) const;
    // (m,) of the resisted rigid-body motions z (c,) and elastic coordinates (e,).
    Vector configuration(const Vector& motion, const Vector& elastic) const;

    Matrix resisted_;       // B (rigid-body coordinates, c), orthonormal
    Vector compliance_;     // Omega_e^-2 (e,)
    Vector inverse_;        // 1 / K (d,), zero of rigid directions
    Vector sprung_;         // (d,) 1 where K is not zero, else 0: there the force is constant
    Matrix deflections_;    // P_e^T Omega_e^-2 (d, e)
    Matrix coupling_;       // P_0^T B (d, c)
    Matrix flexibility_;    // P_e^T Omega_e^-2 P_e (d, d)
    Vector sizes_, scales_;  // of unknowns and of equations (d + c,): pivots do not depend on units
    LinearSolver solver_;
};

// The response to a load (m,) and gaps (k,) of closed links, independent ones where rigid, without modes of a level.
Deflection static_deflection(const Base& base, const std::vector<int>& closed, const Vector& load, const Vector& gaps);

// The gaps (l,) of all links at y (m,), from those (k,) of the closed ones at y = 0, which are zero of the others.
Vector gaps_at(const Base& base, const std::vector<int>& closed, const Vector& configuration, const Vector& gaps);

// Sums with zeros in place of round-off of their terms, whose absolute values add up to `sizes`.
Vector without_round_off(const Vector& sums, const Vector& sizes);

}  // namespace multiphi
