#include "bindings/bindings.hpp"

NB_MODULE(_core, module) {
    // A body in Exudyn lives until the process ends, as the system keeps its functions: nanobind would report it.
    nanobind::set_leak_warnings(false);
    module.doc() = "The method: levels, transitions, the law of events, and runs from event to event.";
    multiphi::bindings::bind_failure(module);
    multiphi::bindings::bind_model(module);
    multiphi::bindings::bind_levels(module);
    multiphi::bindings::bind_level_modes(module);
    multiphi::bindings::bind_orthonormal(module);
    multiphi::bindings::bind_complementarity(module);
    multiphi::bindings::bind_search(module);
    multiphi::bindings::bind_run(module);
    multiphi::bindings::bind_sampler(module);
    multiphi::bindings::bind_splitting(module);
    multiphi::bindings::bind_response(module);
    multiphi::bindings::bind_work(module);
    multiphi::bindings::bind_step_test(module);
}
