// Rows of a level: from its modes psi the gaps, the damping matrix and the forces of closed contacts.
//
// The force of a closed compliant contact follows from its gap. The reactions rho (c,) of rigid contacts H_r are, in
// every mode, a least squares solution of
//
//     (Omega^2 - omega^2) psi - (force of the springs) = H_r rho,   C_l psi = H_r rho'
//
// the first one weighted by 1 / (Omega^2 + |omega^2|), in which no mode of the base outweighs the others.
#pragma once

#include <vector>

#include "linear_algebra.hpp"

namespace multiphi {

// What rows of levels take of the base, whose numbers these are.
struct BaseRows {
    Eigen::Ref<const Matrix> observed;   // rows of l links, then of points (k, m)
    Eigen::Ref<const Vector> sizes;      // of these rows, then of the coordinates, in a mode of length one (k + m,)
    Eigen::Ref<const Vector> squares;    // Omega^2 (m,) [rad2/s2]
    Eigen::Ref<const Matrix> restoring;  // forces of links per gap and per gap velocity (2, l), zero of rigid ones

    Index modes() const { return observed.cols(); }
    Index links() const { return restoring.cols(); }
};

struct LevelRows {
    Matrix modes;        // Psi^T (r, m) of unique signs
    Matrix damping;      // D (r, r)
    Matrix gaps;         // of all links (l, r)
    Matrix forces;       // of closed links (k, r) from eta,
    Matrix force_rates;  //   and from eta'
    std::vector<bool> following;  // links (l,) that rigid ones hold, and those that no mode moves
};

// The rows of a level of omega^2 (r,) and Psi^T (r, m), of which C_l psi (r, m), the gaps (l, r) and D (r, r) are given
// for these modes, of any sign. closed: numbers of links. rigid: places of the rigid ones among them, independent ones.
LevelRows level_rows(const BaseRows& base, const std::vector<int>& closed, const std::vector<int>& rigid,
                     const Vector& squares, Matrix modes, Matrix damped, Matrix gaps, Matrix damping);

}  // namespace multiphi
