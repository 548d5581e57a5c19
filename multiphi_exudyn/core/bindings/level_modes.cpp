// Bindings of what a level's modes are made of: rank-one changes, signs, and the rows that follow from modes.
#include <nanobind/eigen/dense.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <optional>
#include <stdexcept>
#include <tuple>
#include <utility>
#include <vector>

#include "aligned_modes.hpp"
#include "bindings/bindings.hpp"
#include "level_rows.hpp"
#include "residual_boundary.hpp"
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

void require_observed(const Given& rows, const GivenVector& sizes) {
    require(sizes.size() == rows.rows() + rows.cols(), "sizes: need one of every row and coordinate");
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

Vector signs_of(const Matrix& modes, const Given& rows, const GivenVector& sizes) {
    require(modes.cols() == rows.cols(), "modes: need as many coordinates as rows have");
    require_observed(rows, sizes);
    return signs(modes, rows, sizes);
}

LevelRows rows_of(const Given& observed, const GivenVector& sizes, const GivenVector& squares_of_base,
                  const Given& restoring, const std::vector<int>& closed, const std::vector<int>& rigid,
                  const Vector& squares, Matrix modes, Matrix damped, Matrix gaps, Matrix damping) {
    const Index m = observed.cols(), r = squares.size(), links = restoring.cols();
    require_observed(observed, sizes);
    require(squares_of_base.size() == m, "squares of the base: need one of every coordinate");
    require(restoring.rows() == 2 && links <= observed.rows(), "restoring: need two numbers of every link");
    require(modes.rows() == r && modes.cols() == m, "modes: need (r, m)");
    require(damped.rows() == r && damped.cols() == m, "damped: need (r, m)");
    require(gaps.rows() == links && gaps.cols() == r, "gaps: need (links, r)");
    require(damping.rows() == r && damping.cols() == r, "damping: need (r, r)");
    for (const int link : closed) require(link >= 0 && link < links, "closed: need numbers of links");
    for (const int place : rigid) {
        require(place >= 0 && place < static_cast<int>(closed.size()), "rigid: need places of closed links");
    }
    return level_rows({observed, sizes, squares_of_base, restoring}, closed, rigid, squares, std::move(modes),
                      std::move(damped), std::move(gaps), std::move(damping));
}

std::tuple<Vector, Matrix, Matrix> on_residual(const Vector& squares, const Matrix& gaps, const Matrix& flexibility,
                                               const Vector& compliances) {
    const Index k = gaps.rows();
    require(gaps.cols() == squares.size(), "gaps: need (k, r)");
    require(flexibility.rows() == k && flexibility.cols() == k, "flexibility: need (k, k)");
    require(compliances.size() == k, "compliances: need one of every contact");
    ResidualModes modes = residual_modes(squares, gaps, flexibility, compliances);
    return {std::move(modes.squares), std::move(modes.rotation), std::move(modes.forces)};
}

Eigen::Array<bool, Eigen::Dynamic, 1> following_of(const LevelRows& rows) {
    Eigen::Array<bool, Eigen::Dynamic, 1> result(static_cast<Index>(rows.following.size()));
    for (Index i = 0; i < result.size(); ++i) result[i] = rows.following[static_cast<std::size_t>(i)];
    return result;
}

}  // namespace

void bind_level_modes(nb::module_& module) {
    module.attr("MOVES") = moves;
    module.def("clusters", &clusters, "squares"_a, "The first and one past the last of equal omega^2 (r,).");
    module.def("signs", &signs_of, "modes"_a, "rows"_a, "sizes"_a,
               "Signs (r,) that make the first value of each mode (r, m) in rows (k, m) positive.");
    module.def("rank_one_modes", &rank_one, "d"_a, "p"_a, "stiffness"_a, "count"_a,
               "most_steps"_a = most_steps_of_a_root,
               "The lowest eigenvalues (count,) and vectors (count, m) of diag(d) + k p p^T; None if there are fewer.");
    module.def("residual_modes", &on_residual, "squares"_a, "gaps"_a, "flexibility"_a, "compliances"_a,
               "omega^2 (r,), their modes (r, r) in those of the host, and the forces (k, r) of contacts that act through "
               "the flexibility of the modes left out.");
    nb::class_<LevelRows>(module, "LevelRows", "Gaps, damping and contact forces from the modes of a level.")
        .def_prop_ro("modes", [](const LevelRows& rows) { return rows.modes; })
        .def_prop_ro("damping", [](const LevelRows& rows) { return rows.damping; })
        .def_prop_ro("gaps", [](const LevelRows& rows) { return rows.gaps; })
        .def_prop_ro("forces", [](const LevelRows& rows) { return rows.forces; })
        .def_prop_ro("force_rates", [](const LevelRows& rows) { return rows.force_rates; })
        .def_prop_ro("following", &following_of);
    module.def("level_rows", &rows_of, "observed"_a, "sizes"_a, "squares_of_base"_a, "restoring"_a, "closed"_a,
               "rigid"_a, "squares"_a, "modes"_a, "damped"_a, "gaps"_a, "damping"_a,
               "The rows of a level of omega^2 (r,) and modes (r, m) of any sign, from C psi (r, m), gaps and D.");
}

}  // namespace multiphi::bindings
