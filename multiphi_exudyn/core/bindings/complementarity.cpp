#include "bindings/bindings.hpp"

#include <nanobind/eigen/dense.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <optional>
#include <string>
#include <stdexcept>
#include <vector>

#include "complementarity.hpp"
#include "linear_algebra.hpp"

namespace nb = nanobind;

namespace multiphi::bindings {

namespace {

using Given = Eigen::Ref<const Matrix>;
using GivenVector = Eigen::Ref<const Vector>;

std::vector<double> numbers(const GivenVector& vector, const char* name, Index count) {
    if (vector.size() != count) throw std::invalid_argument(std::string(name) + ": need one number for every row");
    return {vector.data(), vector.data() + vector.size()};
}

void fill(Rows& rows, const Given& given) {
    for (int k = 0; k < rows.count(); ++k) std::copy_n(given.row(k).data(), rows.length(), rows[k]);
}

// A whole problem at once, for Python.
void fill_problem(SmallProblem* problem, const Given& rows, const GivenVector& values, const GivenVector& sizes,
                  const GivenVector& lower, const GivenVector& upper, const std::optional<Matrix>& pushing_rows,
                  const std::optional<std::vector<int>>& leaders, const std::optional<Vector>& ratios) {
    const int count = static_cast<int>(rows.rows());
    new (problem) SmallProblem();
    problem->pose(count, static_cast<int>(rows.cols()));
    fill(problem->rows, rows);
    problem->values = numbers(values, "values", count);
    problem->sizes = numbers(sizes, "sizes", count);
    problem->lower = numbers(lower, "lower", count);
    problem->upper = numbers(upper, "upper", count);
    if (pushing_rows) {
        if (pushing_rows->rows() != rows.rows() || pushing_rows->cols() != rows.cols()) {
            throw std::invalid_argument("pushing_rows: need the shape of rows");
        }
        problem->separate_pushing_rows();
        fill(problem->pushing_rows, *pushing_rows);
    }
    if (leaders) {
        const bool in_range = std::all_of(leaders->begin(), leaders->end(),
                                          [count](int each) { return each >= -1 && each < count; });
        if (leaders->size() != static_cast<std::size_t>(count) || !in_range) {
            throw std::invalid_argument("leaders: need one row for every row, or -1");
        }
        problem->leaders = *leaders;
    }
    if (ratios) problem->ratios = numbers(*ratios, "ratios", count);
}

Vector as_vector(const std::vector<double>& numbers) {
    return Eigen::Map<const Vector>(numbers.data(), static_cast<Index>(numbers.size()));
}

}  // namespace

void bind_complementarity(nb::module_& module) {
    nb::class_<SmallProblem> problem(module, "SmallProblem",
                                     "w = A x + b, x = G^T z, with low <= z <= high complementary to w.");
    nb::enum_<SmallProblem::Side>(problem, "Side", "Where a row is.")
        .value("below", SmallProblem::Side::below)
        .value("free", SmallProblem::Side::free)
        .value("above", SmallProblem::Side::above)
        .value("waiting", SmallProblem::Side::waiting);
    nb::enum_<SmallProblem::Outcome>(problem, "Outcome", "Whether a problem has a solution.")
        .value("solved", SmallProblem::Outcome::solved)
        .value("excluded", SmallProblem::Outcome::excluded)
        .value("undecided", SmallProblem::Outcome::undecided);
    nb::enum_<SmallProblem::Order>(problem, "Order", "Which of several violated rows is driven first.")
        .value("most_violated", SmallProblem::Order::most_violated)
        .value("in_turn", SmallProblem::Order::in_turn);
    problem
        .def("__init__", &fill_problem, nb::arg("rows"), nb::arg("values"), nb::arg("sizes"), nb::arg("lower"),
             nb::arg("upper"), nb::arg("pushing_rows") = nb::none(), nb::arg("leaders") = nb::none(),
             nb::arg("ratios") = nb::none())
        .def("solve", &SmallProblem::solve, nb::arg("order"))
        .def("free_balanced_rows", &SmallProblem::free_balanced_rows)
        .def_prop_ro("change", [](const SmallProblem& self) { return as_vector(self.change); })
        .def_prop_ro("multipliers", [](const SmallProblem& self) { return as_vector(self.multipliers); })
        .def_ro("sides", &SmallProblem::sides)
        .def_ro("excluding", &SmallProblem::excluding);
}

}  // namespace multiphi::bindings
