// Bindings of what a level's modes are made of: rank-one changes, singular values, signs and bases of clusters.
#include <nanobind/eigen/dense.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <optional>
#include <stdexcept>
#include <tuple>
#include <utility>
#include <vector>

#include "aligned_modes.hpp"
#include "bindings/bindings.hpp"
#include "jacobi_singular_values.hpp"
#include "secular_equation.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace multiphi::bindings {

namespace {

using Given = Eigen::Ref<const Matrix>;
using GivenVector = Eigen::Ref<const Vector>;

void require(bool holds, const char* need) {
    if (!holds) throw std::invalid_argument(need);
}

std::optional<std::pair<Vector, Matrix>> rank_one(const Vector& d, const Vector& p, double stiffness, int count,
                                                  int most_steps) {
    require(p.size() == d.size(), "p: need a number for every d");
    require(count > 0 && count <= d.size(), "count: need 1 to the number of d");
    require(stiffness > 0.0, "stiffness: need a positive number");
    std::optional<RankOneModes> modes = rank_one_modes(d, p, stiffness, count, most_steps);
    if (!modes) return std::nullopt;
    return std::make_pair(std::move(modes->values), std::move(modes->vectors));
}

std::tuple<Vector, Matrix, Matrix> aligned(Vector squares, Matrix modes, const Given& rows, const GivenVector& sizes) {
    require(modes.cols() == rows.cols() && modes.rows() == squares.size(), "modes: need (r, m)");
    require(sizes.size() == rows.rows() + rows.cols(), "sizes: need one of every row and coordinate");
    align_clusters(squares, modes, rows, sizes);
    modes = signs(modes, rows, sizes).asDiagonal() * modes;
    Matrix values = rows * modes.transpose();
    return {std::move(squares), std::move(modes), std::move(values)};
}

std::pair<Vector, Matrix> singular(const Matrix& matrix) {
    require(matrix.rows() >= matrix.cols(), "matrix: need (k, n), k >= n");
    JacobiSingularValues found = jacobi_singular_values(matrix);
    return {std::move(found.values), std::move(found.vectors)};
}

}  // namespace

void bind_level_modes(nb::module_& module) {
    module.def("clusters", &clusters, "squares"_a, "The first and one past the last of equal omega^2 (r,).");
    module.def("cluster_end", &cluster_end, "squares"_a, "count"_a,
               "The least number of modes >= count that parts no cluster; None where the last omega^2 are one.");
    module.def("aligned_modes", &aligned, "squares"_a, "modes"_a, "rows"_a, "sizes"_a,
               "omega^2 (r,), modes (r, m) and values of rows (k, r) with unique signs and bases of clusters.");
    module.def("jacobi_singular_values", &singular, "matrix"_a, "Singular values ascending (n,), right vectors (n, n).");
    module.def("rank_one_modes", &rank_one, "d"_a, "p"_a, "stiffness"_a, "count"_a,
               "most_steps"_a = most_steps_of_a_root,
               "The lowest eigenvalues (count,) and vectors (count, m) of diag(d) + k p p^T; None if there are fewer.");
}

}  // namespace multiphi::bindings
