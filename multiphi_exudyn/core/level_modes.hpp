// Modes of a level: omega^2 and shapes of the base's stiffness with closed contacts added (eq. 38.2).
//
//     [ Omega^2 + sum_springs k p p^T ] psi = omega^2 psi,   p.psi = 0 along rigid directions
//
// A few directions are as many rank-one changes, roots of their secular equations (secular_equation.hpp). Where many
// are closed, the lowest modes are the largest eigenvectors of the level's compliance, which differs from that of the
// base by a matrix of rank d,
//
//     A = Omega^-2 - Omega^-2 P (1/K + P^T Omega^-2 P)^-1 P^T Omega^-2                              (rigid: 1/K = 0)
//
// by Lanczos iterations; Sylvester's law of inertia shows whether one is missing: below sigma a level has
//
//     #(Omega^2 < sigma) - #(eigenvalues <= 0 of 1/K + P^T (Omega^2 - sigma)^-1 P)
//
// modes. Otherwise, and in the space of few vectors that iterations have found, the omega are singular values of
// [diag(Omega) Z; sqrt(K) P^T Z], Z an orthonormal basis of that space or of what rigid contacts allow: as accurate as
// those of the base. Springs K < 0 follow on these modes, W = Psi^T p sqrt|K|, as
//
//     omega^2 + mu - W W^T = (R B)^T R B,   B = diag(omega^2 + mu)^1/2,   R^T R = I - (B^-1 W)(B^-1 W)^T
//
// again by singular values; mu = 0 unless the level is indefinite or nearly so.
#pragma once

#include <optional>

#include "base.hpp"
#include "closed_directions.hpp"
#include "linear_algebra.hpp"

namespace multiphi {

struct LevelModes {
    Vector squares;         // omega^2 (r,) ascending
    Matrix modes;           // Psi^T (r, m), orthonormal, of any sign
    double accuracy = 0.0;  // mu, which limits that of omega^2
};

// The lowest `count` modes at least, or all. Throws LevelFailure where the modes are not orthogonal.
LevelModes level_modes(const Base& base, const ClosedDirections& directions, int count);

// The eigenvectors (count, m) of the largest eigenvalues of A; none where one may be missing. directions (d, m): those
// with a stiffness (d,) that is not zero.
std::optional<Matrix> lanczos_modes(const Base& base, const Matrix& directions, const Vector& stiffness, int count);

}  // namespace multiphi
