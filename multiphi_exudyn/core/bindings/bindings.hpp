// Bindings: what Python sees of the core, one file for each part of it.
#pragma once

#include <nanobind/nanobind.h>

namespace multiphi::bindings {

void bind_complementarity(nanobind::module_& module);
void bind_failure(nanobind::module_& module);
void bind_level_modes(nanobind::module_& module);
void bind_levels(nanobind::module_& module);
void bind_model(nanobind::module_& module);
void bind_orthonormal(nanobind::module_& module);
void bind_run(nanobind::module_& module);
void bind_sampler(nanobind::module_& module);
void bind_search(nanobind::module_& module);
void bind_splitting(nanobind::module_& module);
void bind_step_test(nanobind::module_& module);
void bind_response(nanobind::module_& module);
void bind_work(nanobind::module_& module);

}  // namespace multiphi::bindings
