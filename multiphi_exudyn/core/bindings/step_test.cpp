// Binding of the step test, which reads the state of a solver where the solver keeps it.
#include "bindings/bindings.hpp"

#include <nanobind/eigen/dense.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/vector.h>

#include <new>
#include <utility>
#include <vector>

#include "step_test.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace multiphi::bindings {

namespace {

using View = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

// A step test with the arrays that it reads.
struct ReadingTest {
    View displacement, velocity, acceleration, multipliers;
    StepTest test;
};

}  // namespace

void bind_step_test(nb::module_& module) {
    nb::class_<StepConditions>(module, "StepConditions", "The rows that have to be exceeded in one level.")
        .def("__init__",
             [](StepConditions* self, Matrix rows, int end_count, int first_at_start, Matrix norm, int points, int held,
                int channels, bool has_point_forces) {
                 new (self) StepConditions{std::move(rows), end_count, first_at_start, std::move(norm),
                                           points,          held,      channels,       has_point_forces};
             },
             nb::kw_only(), "rows"_a, "end_count"_a, "first_at_start"_a, "norm"_a, "points"_a, "held"_a, "channels"_a,
             "has_point_forces"_a);
    nb::class_<ReadingTest>(module, "StepTest", "Whether no event can have occurred within a step of a solver.")
        .def("__init__",
             [](ReadingTest* self, const StepConditions& conditions, double step, double rounding, View displacement,
                View velocity, View acceleration, View multipliers, std::vector<int> point_forces) {
                 SolverState state{displacement.data(), velocity.data(), acceleration.data(), multipliers.data(),
                                   std::move(point_forces)};
                 new (self) ReadingTest{std::move(displacement), std::move(velocity), std::move(acceleration),
                                        std::move(multipliers),
                                        StepTest(conditions, step, rounding, std::move(state))};
             },
             "conditions"_a, "step"_a, "rounding"_a, "displacement"_a.noconvert(), "velocity"_a.noconvert(),
             "acceleration"_a.noconvert(), "multipliers"_a.noconvert(), "point_forces"_a)
        .def("begin", [](ReadingTest& self, double time, const Vector& x, bool all_armed) {
            self.test.begin(time, x, all_armed);
        }, "time"_a, "x"_a, "all_armed"_a)
        .def("set_end_channels", [](ReadingTest& self, double t, const Vector& channels) {
            self.test.set_end_channels(t, channels);
        }, "t"_a, "channels"_a)
        .def("is_step_clear", [](ReadingTest& self, double t) { return self.test.is_step_clear(t); }, "t"_a)
        .def_prop_ro("time", [](const ReadingTest& self) { return self.test.time(); })
        .def_prop_ro("start", [](const ReadingTest& self) { return self.test.start(); });
}

}  // namespace multiphi::bindings
