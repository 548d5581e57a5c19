// The secular equation: eigenvalues and vectors of a diagonal matrix to which one direction's stiffness is added.
//
//     diag(d) + k p p^T:   1/k + sum_i p_i^2 / (d_i - x) = 0   (rigid: 1/k = 0),   v_i = p_i / (d_i - x)
//
// There is one root between two neighbours d_l < d_u, and of a spring one above the highest d. It is found as a
// distance from the nearer of them, by zeros of
//
//     c + a / (d_l - x) + b / (d_u - x)
//
// whose c, a and b follow from the sums over the d up to d_l and from d_u on, and from their slopes; so eigenvalues
// have the relative accuracy of the d, for any k, and the vectors are orthogonal to round-off. The exception are two
// roots next to a d from which they differ by round-off alone: their vectors are correct as a pair only. Unit vectors
// without a part in p are deflated: components that are zero or round-off, and of equal d all but one direction.
// Source: R.-C. Li, Solving secular equations stably and efficiently, LAPACK Working Note 89 (1993).
#pragma once

#include <optional>

#include "linear_algebra.hpp"

namespace multiphi {

inline constexpr int most_steps_of_a_root = 100;  // three to eight are typical

struct RankOneModes {
    Vector values;   // (count,) ascending
    Matrix vectors;  // (count, m), orthonormal, one a row
};

// The `count` lowest eigenvalues and vectors; none where there are fewer, and where a root does not converge. d (m,):
// ascending, none negative. stiffness: k > 0, infinite for the constraint p.v = 0.
std::optional<RankOneModes> rank_one_modes(const Vector& d, const Vector& p, double stiffness, int count,
                                           int most_steps = most_steps_of_a_root);

}  // namespace multiphi
