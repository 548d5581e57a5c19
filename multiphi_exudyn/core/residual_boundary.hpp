// Residual boundary: contacts that act through the flexibility of the modes left out (MacNeal's method).
//
// The modes left out of a level with these contacts open, the host, have stiffness and no inertia. The forces f (k,) of
// the closed contacts bend the structure beside the r modes, by F f at the contacts:
//
//     eta'' + D eta' + diag(omega^2) eta = B^T f,   gaps  B eta + F f + q_0 = -f / k          (rigid: 1/k = 0)
//     f = -A (B eta + q_0),   A = (1/k + F)^-1
//
// So the level keeps the r modes of the host, its stiffness diag(omega^2) + B^T A B is r x r, and no direction is taken
// from the motion: a rigid contact is one of stiffness 1/F, without impacts.
#pragma once

#include "linear_algebra.hpp"

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

}  // namespace multiphi
