// What the bindings of runs and of coupled steps share.
#pragma once

#include <array>
#include <vector>

#include "bindings/bindings.hpp"
#include "failure.hpp"

namespace multiphi::bindings {

// Why a run ended before its time, as a status.
struct Failure {
    Cause cause;
    std::vector<int> elements;
    std::array<double, 3> details;
};

void bind_coupled_step(nanobind::module_& module);

}  // namespace multiphi::bindings
