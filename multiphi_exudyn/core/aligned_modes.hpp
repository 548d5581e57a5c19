// Aligned modes: their signs, and which of them have one frequency, the same on every processor.
//
// The sign of a mode, and the basis of a space of modes of one frequency, are arbitrary: an eigensolver chooses them by
// round-off. The first of some rows that has a value in a mode has a positive one; mathematics/modes.py
// chooses the bases.
#pragma once

#include <utility>
#include <vector>

#include "linear_algebra.hpp"

namespace multiphi {

// Of the largest value of a row: of smaller values, round-off could choose the sign of a mode.
inline constexpr double moves = 1e-5;

// The first and one past the last mode of every cluster of two or more equal omega^2 (r,), which ascend.
std::vector<std::pair<int, int>> clusters(const Vector& squares);

// Signs (r,) with which the first value of each mode (r, m) in rows (k, m), then in its coordinates, is positive. Where
// no value is clear the largest one counts. sizes (k + m,): of rows, then of coordinates, in a mode of length one.
Vector signs(const Matrix& modes, const Eigen::Ref<const Matrix>& rows, const Eigen::Ref<const Vector>& sizes);

}  // namespace multiphi
