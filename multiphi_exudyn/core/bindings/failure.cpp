#include "bindings/bindings.hpp"

#include <stdexcept>
#include <string>

#include "failure.hpp"

namespace nb = nanobind;

namespace multiphi::bindings {

namespace {

// What Python is told of the failures of a level; those of a run are statuses, with messages of their own.
const char* message_of(const NumericalFailure& failure) {
    if (failure.cause() == Cause::level_not_finite) return "modes: stiffness or damping of a level is not finite";
    if (failure.cause() == Cause::indistinct_modes) {
        return "modes: two coupled modes of a level are critically damped alike, to round-off; change the damping a "
               "little";
    }
    if (failure.cause() == Cause::cancelled_stiffness) {
        return "modes: friction cancels the stiffness of a mode beside a zero-frequency mode";
    }
    return failure.what();
}

// Raises a NumericalFailure of the core as that of the package, and what nobody has meant as its MultiPhiError.
void raise_failure(const std::exception_ptr& thrown, void*) {
    try {
        std::rethrow_exception(thrown);
    } catch (const NumericalFailure& failure) {
        const nb::object type = nb::module_::import_("multiphi_exudyn.errors").attr("NumericalFailure");
        PyErr_SetString(type.ptr(), message_of(failure));
    } catch (const LevelFailure& failure) {
        const nb::object type = nb::module_::import_("multiphi_exudyn.errors").attr("NumericalFailure");
        PyErr_SetString(type.ptr(), failure.what());
    } catch (const ArgumentError& error) {
        const nb::object type = nb::module_::import_("multiphi_exudyn.errors").attr("MultiPhiValueError");
        PyErr_SetString(type.ptr(), error.what());
    } catch (const nb::builtin_exception&) {
        throw;  // an error of an argument, which nanobind raises
    } catch (const std::invalid_argument&) {
        throw;  // the same of the bindings: a ValueError
    } catch (const std::logic_error& error) {
        const nb::object type = nb::module_::import_("multiphi_exudyn.errors").attr("MultiPhiError");
        PyErr_SetString(type.ptr(), (std::string("core: ") + error.what() + "; this is a bug, please report it").c_str());
    }
}

}  // namespace

void bind_failure(nb::module_& module) {
    nb::enum_<Cause>(module, "Cause", "Why a run ends before its time.")
        .value("not_finite", Cause::not_finite)
        .value("search_too_long", Cause::search_too_long)
        .value("chatter", Cause::chatter)
        .value("not_admissible", Cause::not_admissible)
        .value("squeezed", Cause::squeezed)
        .value("unsettled", Cause::unsettled)
        .value("mixed_restitution", Cause::mixed_restitution)
        .value("gaining_energy", Cause::gaining_energy)
        .value("record_full", Cause::record_full)
        .value("level_not_finite", Cause::level_not_finite)
        .value("indistinct_modes", Cause::indistinct_modes)
        .value("cancelled_stiffness", Cause::cancelled_stiffness);
    nb::register_exception_translator(raise_failure);
}

}  // namespace multiphi::bindings
