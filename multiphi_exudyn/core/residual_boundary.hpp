// Residual boundary: contacts that act through the flexibility of the modes left out (MacNeal's method).
//
// The modes left out of a level with these contacts open, the host, have stiffness and no inertia. The forces f (k,) of
// the closed contacts bend the structure beside the r modes, by F f at the contacts:
//
//     eta'' + D eta' + diag(omega^2) eta = B^T f,   gaps  B eta + F f + q_0 = -f / k          (rigid: 1/k = 0)
//     f = -A (B eta + q_0),   A = (1/k + F)^-1
//
// So the level keeps the r modes of the host, its stiffness diag(omega^2) + B^T A B is r x r, and no direction is taken
// from the motion: a rigid contact is one of stiffness 1/F, without impacts. A force f along the direction h of a contact
// bends the structure, beside the modes Psi of the host, by
//
//     (K_l^-1 - Psi omega^-2 Psi^T) h f,   F = h^T (K_l^-1 - Psi omega^-2 Psi^T) h
//
// and f follows from the modes. In statics such a level is exact, whatever r.
#pragma once

#include <memory>
#include <vector>

#include "linear_algebra.hpp"
#include "sliding.hpp"

namespace multiphi {

// Modes of a level with closed contacts on a residual boundary, in those of its host: eta = rotation zeta.
struct ResidualModes {
    Vector squares;   // omega^2 (r,), first those of zero frequency
    Matrix rotation;  // (r, r), orthogonal
    Matrix forces;    // (k, r): f = forces zeta
};

// squares: omega^2 (r,) of the host. gaps: B (k, r). flexibility: F (k, k). compliances: 1/k (k,).
ResidualModes residual_modes(const Vector& squares, const Matrix& gaps, const Matrix& flexibility,
                             const Vector& compliances);

// The residual contacts of a host, with what their forces bend beside its modes.
struct ResidualBoundary {
    std::shared_ptr<const MovingLevel> host;
    std::vector<int> links;    // all residual ones (c,)
    Matrix shapes;             // (c, m) at unit forces
    Matrix forces_of_host;     // (c, k) of the links that act in the host
    Matrix gaps;               // of all links at unit forces (l, c)
    Matrix flexibility;        // F (c, c): those of these contacts
    Vector compliances;        // 1/k (c,), zero where rigid

    // Throws ArgumentError for a rigid contact where the host leaves out no modes that bend.
    explicit ResidualBoundary(std::shared_ptr<const MovingLevel> host);
};

}  // namespace multiphi
