#include "bindings/bindings.hpp"

#include <nanobind/eigen/dense.h>

#include "splitting.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace multiphi::bindings {

void bind_splitting(nb::module_& module) {
    module.def("split_steps", split_steps, "step"_a, "flow"_a, "rows"_a, "laws"_a, "record"_a.noconvert(),
               nb::call_guard<nb::gil_scoped_release>(),
               "Fill a record (steps + 1, 2 r) of (z, z') from its first row on, by Strang splitting.");
}

}  // namespace multiphi::bindings
