// Aligned modes: their signs, and the bases of modes of one frequency, the same on every processor.
//
// The sign of a mode, and the basis of a space of modes of one frequency, are arbitrary: an eigensolver chooses them by
// round-off. Rows of some quantities, followed by the coordinates themselves, make both unique: the first row that has a
// value in a mode has a positive one; in a cluster of equal omega^2 the first row with a value has it in the first mode
// only, the first one with a value in the other modes has it in the first of these only, and so on.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "linear_algebra.hpp"

namespace multiphi {

// The first and one past the last mode of every cluster of two or more equal omega^2 (r,), which ascend.
std::vector<std::pair<int, int>> clusters(const Vector& squares);

// The least number of modes >= `count` that parts no cluster, also of omega^2 that are nearly one; none where the last
// omega^2 (r,) are one.
std::optional<int> cluster_end(const Vector& squares, int count);

// Signs (r,) with which the first value of each mode (r, m) in rows (k, m), then in its coordinates, is positive. Where
// no value is clear the largest one counts. sizes (k + m,): of rows, then of coordinates, in a mode of length one.
Vector signs(const Eigen::Ref<const Matrix>& modes, const Eigen::Ref<const Matrix>& rows,
             const Eigen::Ref<const Vector>& sizes);

// Gives the modes (r, m) of every cluster their unique basis, and their mean omega^2 (r,); signs stay any.
void align_clusters(Eigen::Ref<Vector> squares, Eigen::Ref<Matrix> modes, const Eigen::Ref<const Matrix>& rows,
                    const Eigen::Ref<const Vector>& sizes);

}  // namespace multiphi
