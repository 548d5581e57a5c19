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

#include "base.hpp"
#include "linear_algebra.hpp"

namespace multiphi {

struct LevelRows {
    Matrix modes;        // Psi^T (r, m) of unique signs
    Matrix damping;      // D (r, r)
    Matrix gaps;         // of all links (l, r)
    Matrix forces;       // of closed links (k, r) from eta,
    Matrix force_rates;  //   and from eta'
    std::vector<bool> following;  // links (l,) that rigid ones hold, and those that no mode moves
};

// The rows of a level of omega^2 (r,) and Psi^T (r, m) of any sign. closed: numbers of links, independent where rigid.
LevelRows level_rows(const Base& base, const std::vector<int>& closed, const Vector& squares, Matrix modes);

}  // namespace multiphi
