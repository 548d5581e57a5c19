// Bindings of work_integrals.hpp: works in segments that a run has left out.
#include "bindings/bindings.hpp"

#include <nanobind/stl/vector.h>

#include <cstddef>
#include <vector>

#include "levels.hpp"
#include "trajectory.hpp"
#include "work_integrals.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace multiphi::bindings {

namespace {

Works works_of(Levels& levels, const Trajectory& trajectory, const std::vector<int>& segments) {
    const nb::gil_scoped_release released;
    Inputs inputs(levels.excitation());
    WorkIntegrals integrals;
    State start;
    Works total;
    for (const int number : segments) {
        const std::size_t i = static_cast<std::size_t>(number);
        const Segment& segment = trajectory.segments.at(i);
        const Level& level = levels.level(trajectory.keys[static_cast<std::size_t>(segment.level)]);
        inputs.set(segment.interval, segment.age, 0.0, 1.0);
        inputs.set_horizon(segment.horizon);
        start.enter(level);
        const double* coordinates = trajectory.coordinates.data() + segment.coordinates;
        start.displacement = Vector::Map(coordinates, level.width());
        start.velocity = Vector::Map(coordinates + level.width(), level.width());
        measure(start, inputs);
        total += integrals.integrate(start, inputs, trajectory.instants[i + 1] - trajectory.instants[i],
                                     segment.entry_work);
    }
    return total;
}

}  // namespace

void bind_work(nb::module_& module) {
    module.def("works_of_segments", works_of, "levels"_a, "trajectory"_a, "segments"_a,
               "Works [J] in segments of a trajectory, jumps at their starts included, each integrated.");
}

}  // namespace multiphi::bindings
