// Bindings of levels, of their transitions and energies.
#include "bindings/bindings.hpp"

#include <nanobind/eigen/dense.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <limits>
#include <memory>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "energy.hpp"
#include "held_forces.hpp"
#include "levels.hpp"
#include "state.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace multiphi::bindings {

namespace {

// Python functions of the states of a level, or of two, as the core calls them.
struct PythonForces {
    nb::object function;

    HeldForce operator()(const Key& key) const {
        const nb::gil_scoped_acquire acquired;
        const auto [modal, reactions] = nb::cast<std::pair<Vector, Vector>>(function(nb::tuple(nb::cast(key))));
        return {modal, reactions};
    }
};

struct PythonMobility {
    nb::object function;

    Matrix operator()(const Key& key) const {
        const nb::gil_scoped_acquire acquired;
        return nb::cast<Matrix>(function(nb::tuple(nb::cast(key))));
    }
};

struct PythonVelocityMap {
    nb::object function;

    Matrix operator()(const Key& source, const Key& target, const Matrix& matrix) const {
        const nb::gil_scoped_acquire acquired;
        return nb::cast<Matrix>(function(nb::tuple(nb::cast(source)), nb::tuple(nb::cast(target)), matrix));
    }
};

// The functions mostly refer to the object that holds the levels: the garbage collector has to see them.
int visit_held_levels(PyObject* self, visitproc visit, void* arg) {
    Py_VISIT(Py_TYPE(self));
    if (!nb::inst_ready(self)) return 0;
    const HeldLevels& levels = *nb::inst_ptr<HeldLevels>(self);
    if (const auto* forces = levels.forces().target<PythonForces>()) Py_VISIT(forces->function.ptr());
    if (!levels.inertia()) return 0;
    if (const auto* mobility = levels.inertia()->mobility.target<PythonMobility>()) Py_VISIT(mobility->function.ptr());
    if (const auto* map = levels.inertia()->velocity_map.target<PythonVelocityMap>()) Py_VISIT(map->function.ptr());
    return 0;
}

int clear_held_levels(PyObject* self) {
    if (nb::inst_ready(self)) nb::inst_ptr<HeldLevels>(self)->set_forces({}, std::nullopt);
    return 0;
}

PyType_Slot held_levels_slots[] = {{Py_tp_traverse, reinterpret_cast<void*>(visit_held_levels)},
                                   {Py_tp_clear, reinterpret_cast<void*>(clear_held_levels)},
                                   {0, nullptr}};

void bind_held_levels(nb::module_& module) {
    nb::class_<HeldLevels, Levels>(module, "HeldLevels", nb::type_slots(held_levels_slots),
                                   "The levels of a model under constant forces that others hold for a step.")
        .def(nb::init<std::shared_ptr<Model>, std::shared_ptr<Excitation>, double>(), "model"_a, "excitation"_a,
             "duration"_a = std::numeric_limits<double>::infinity())
        .def(
            "set_forces",
            [](HeldLevels& levels, nb::callable forces, std::optional<std::pair<nb::callable, nb::callable>> inertia) {
                std::optional<AttachedInertia> attached;
                if (inertia)
                    attached = AttachedInertia{PythonMobility{std::move(inertia->first)},
                                               PythonVelocityMap{std::move(inertia->second)}};
                levels.set_forces(PythonForces{std::move(forces)}, std::move(attached));
            },
            "forces"_a, "inertia"_a = nb::none(),
            "forces: modal force and direct reactions by the states of a level. inertia: F by the states, and the map "
            "of velocities from one level to another.")
        .def("forget", &HeldLevels::forget);
}

ComplexVector as_vector(const std::vector<Complex>& values) {
    return ComplexVector::Map(values.data(), static_cast<Index>(values.size()));
}

State state_in(const Level& level, const Vector& displacement, const Vector& velocity) {
    State state;
    state.enter(level);
    state.displacement = displacement;
    state.velocity = velocity;
    return state;
}

void bind_signals(nb::module_& module) {
    nb::class_<Signal>(module, "Signal", "displacement.xi + velocity.xi' + constant, and its part of each exponential.")
        .def_prop_ro("displacement", [](const Signal& signal) { return Vector(signal.row.displacement); })
        .def_prop_ro("velocity", [](const Signal& signal) { return Vector(signal.row.velocity); })
        .def_prop_ro("constant", [](const Signal& signal) { return signal.row.constant; })
        .def_prop_ro("depends_on_velocity", [](const Signal& signal) { return signal.row.depends_on_velocity; })
        .def_prop_ro("exponentials", [](const Signal& signal) { return as_vector(signal.exponentials); })
        .def_prop_ro("velocity_exponentials",
                     [](const Signal& signal) { return as_vector(signal.velocity_exponentials); });
    nb::class_<VelocityTarget>(module, "VelocityTarget")
        .def_ro("velocity", &VelocityTarget::velocity)
        .def_ro("forward", &VelocityTarget::forward)
        .def_ro("backward", &VelocityTarget::backward);
    nb::class_<Guard>(module, "Guard", "A way out of the present state of an element.")
        .def_ro("element", &Guard::element)
        .def_ro("target", &Guard::target)
        .def_ro("rule", &Guard::rule)
        .def_ro("signal", &Guard::signal)
        .def_prop_ro("by_velocity", [](const Guard& guard) { return guard.by_velocity; });
}

void bind_level(nb::module_& module) {
    nb::class_<PotentialForm>(module, "PotentialForm")
        .def_ro("constant", &PotentialForm::constant)
        .def_prop_ro("linear", [](const PotentialForm& form) { return Vector(form.linear); })
        .def_prop_ro("squares", [](const PotentialForm& form) { return Vector(form.squares); })
        .def_prop_ro("rows", [](const PotentialForm& form) { return Matrix(form.rows); })
        .def_prop_ro("follows", [](const PotentialForm& form) { return Matrix(form.follows); });
    nb::class_<Level>(module, "Level", "The linear system that holds while every element keeps its state.")
        .def_prop_ro("key", [](const Level& level) { return nb::tuple(nb::cast(level.key())); })
        .def_prop_ro("number", &Level::number)
        .def_prop_ro("modes", &Level::modes)
        .def_prop_ro("channels", &Level::channels)
        .def_prop_ro("prescribed", &Level::prescribed)
        .def_prop_ro("omega", &Level::omega, nb::rv_policy::copy)
        .def_prop_ro("periods", &Level::periods, nb::rv_policy::copy)
        .def_prop_ro("highest_frequency", &Level::highest_frequency)
        .def_prop_ro("links", [](const Level& level) { return nb::tuple(nb::cast(level.data().links)); })
        .def_prop_ro("squares", [](const Level& level) { return Vector(level.data().squares); })
        .def_prop_ro("computed", [](const Level& level) { return Vector(level.data().computed); })
        .def_prop_ro("damping_matrix", [](const Level& level) { return Matrix(level.data().damping_matrix); })
        .def_prop_ro("damping", [](const Level& level) { return Matrix(level.data().damping); })
        .def_prop_ro("coupling", [](const Level& level) { return Matrix(level.data().coupling); })
        .def_prop_ro("shapes", [](const Level& level) { return level.data().shapes(); })
        .def_prop_ro("configuration", [](const Level& level) { return Vector(level.data().configuration); })
        .def_prop_ro("drive", [](const Level& level) { return Vector(level.data().drive); })
        .def_prop_ro("static_drive", [](const Level& level) { return Vector(level.data().static_drive); })
        .def_prop_ro("load", [](const Level& level) { return Vector(level.data().load); })
        .def_prop_ro("static_strain", [](const Level& level) { return level.data().strain; })
        .def_prop_ro("stored", [](const Level& level) { return level.data().stored; })
        .def_prop_ro("gap_rows", [](const Level& level) { return Matrix(level.data().gap_rows); })
        .def_prop_ro("gap_constants", [](const Level& level) { return Vector(level.data().gap_constants); })
        .def_prop_ro("velocity_rows", [](const Level& level) { return Matrix(level.data().velocity_rows); })
        .def_prop_ro("force_rows", [](const Level& level) { return Matrix(level.data().force_rows); })
        .def_prop_ro("force_velocity_rows", [](const Level& level) { return Matrix(level.data().force_velocity_rows); })
        .def_prop_ro("forces", [](const Level& level) { return Vector(level.data().forces); })
        .def_prop_ro("channel_force", [](const Level& level) { return Matrix(level.data().channel_force); })
        .def_prop_ro("channel_force_rate", [](const Level& level) { return Matrix(level.data().channel_force_rate); })
        .def_prop_ro("channel_shapes", [](const Level& level) { return Matrix(level.data().channel_shapes); })
        .def_prop_ro("carried", [](const Level& level) { return Matrix(level.data().carried); })
        .def_prop_ro("response", &Level::response, nb::rv_policy::reference_internal)
        .def_prop_ro("displacement_acceleration", &Level::displacement_acceleration, nb::rv_policy::copy)
        .def_prop_ro("velocity_acceleration", &Level::velocity_acceleration, nb::rv_policy::copy)
        .def_prop_ro("constant_acceleration", &Level::constant_acceleration, nb::rv_policy::copy)
        .def_prop_ro("drives_free_modes", &Level::drives_free_modes)
        .def_prop_ro("guards", &Level::guards, nb::rv_policy::copy)
        .def("first_guard", &Level::first_guard, "element"_a)
        .def("opening", &Level::opening, "element"_a, nb::rv_policy::reference_internal)
        .def_prop_ro("potential", &Level::potential, nb::rv_policy::reference_internal)
        .def_prop_ro("patterns", &Level::patterns, nb::rv_policy::copy)
        .def("response_sizes", &Level::response_sizes, "part"_a, nb::rv_policy::copy)
        .def_prop_ro("rates", [](const Level& level) { return as_vector(level.response().basis.rates); })
        .def(
            "free_motion",
            [](const Level& level, const Vector& displacement, const Vector& velocity) {
                ComplexVector result(level.response().basis.size());
                level.response().coefficients(displacement.data(), velocity.data(), nullptr, result.data());
                return result;
            },
            "displacement"_a, "velocity"_a, "Coefficients on the exponentials of the free motion from eta, eta'.")
        .def_prop_ro("size_factor", &Level::size_factor, nb::rv_policy::copy)
        .def_prop_ro("static_work", &Level::static_work, nb::rv_policy::copy)
        .def_prop_ro("struck_defects", &Level::struck_defects, nb::rv_policy::copy)
        .def_prop_ro("bytes", &Level::bytes);
}

void bind_energies(nb::module_& module) {
    module.def(
        "energies",
        [](const Level& level, const Vector& displacement, const Vector& velocity) {
            const State state = state_in(level, displacement, velocity);
            return std::tuple(kinetic_energy(state), potential_energy(state), load_work(state), strain_energy(state));
        },
        "level"_a, "displacement"_a, "velocity"_a,
        "Kinetic and potential energy, potential of varying loads and strain energy [J] of xi, xi'.");
    module.def(
        "losses",
        [](const Level& left, const Vector& displacement, const Vector& velocity, const Level& entered,
           const Vector& displacement_after, const Vector& velocity_after, double collided) {
            Loss loss;
            add_losses(state_in(left, displacement, velocity), left.key(),
                       state_in(entered, displacement_after, velocity_after), collided, loss);
            return std::tuple(loss.impact, loss.truncation_kinetic, loss.truncation_strain, loss.stop_work,
                              loss.damping, loss.friction);
        },
        "left"_a, "displacement"_a, "velocity"_a, "entered"_a, "displacement_after"_a, "velocity_after"_a,
        "collided"_a, "Energies [J] that a change of level takes.");
}

}  // namespace

void bind_levels(nb::module_& module) {
    bind_signals(module);
    bind_level(module);
    nb::class_<Transition>(module, "Transition", "A state expressed in the coordinates of the next level.")
        .def(nb::init<const Level&, const Level&>(), "source"_a, "target"_a, nb::keep_alive<1, 2>(),
             nb::keep_alive<1, 3>())
        .def_prop_ro("matrix", [](const Transition& transition) { return Matrix(transition.matrix); })
        .def_prop_ro("velocity_matrix", [](const Transition& transition) { return Matrix(transition.velocity_matrix); })
        .def_prop_ro("offset", [](const Transition& transition) { return Vector(transition.offset); })
        .def_prop_ro("terms", [](const Transition& transition) { return transition.terms; })
        .def_prop_ro("start_sizes", [](const Transition& transition) { return Matrix(transition.start_sizes); });
    nb::class_<DefectForm>(module, "DefectForm", "Maps of (1, xi, s) and (xi', s') to what a level entered cannot hold.")
        .def(nb::init<const Transition&, const std::vector<int>&>(), "transition"_a, "stopped"_a,
             "stopped: links along which an impact has left no velocity.")
        .def_prop_ro("displaced", [](const DefectForm& form) { return form.displaced; })
        .def_prop_ro("moving", [](const DefectForm& form) { return form.moving; });
    nb::class_<Levels>(module, "Levels", "The levels of a model under its loads, built on first use.")
        .def(nb::init<std::shared_ptr<Model>, std::shared_ptr<Excitation>, double>(), "model"_a, "excitation"_a,
             "duration"_a = std::numeric_limits<double>::infinity(), "duration: of the longest motion [s].")
        .def_prop_ro("model", &Levels::model, nb::rv_policy::reference_internal)
        .def_prop_ro("base", &Levels::base, nb::rv_policy::reference_internal)
        .def("level", &Levels::level, "states"_a, nb::rv_policy::reference_internal,
             nb::call_guard<nb::gil_scoped_release>())
        .def("transition", &Levels::transition, "source"_a, "target"_a, nb::rv_policy::reference_internal,
             nb::call_guard<nb::gil_scoped_release>())
        .def("entered_signal", &Levels::entered_signal, "level"_a, "guard"_a, nb::rv_policy::reference_internal,
             nb::call_guard<nb::gil_scoped_release>())
        .def("forget_but", &Levels::forget_but, "kept"_a)
        .def_prop_ro("bytes", &Levels::bytes);
    bind_held_levels(module);
    bind_energies(module);
}

}  // namespace multiphi::bindings
