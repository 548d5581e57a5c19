// Bindings of levels, of their transitions and energies. Levels are built by a Python function of the states.
#include "bindings/bindings.hpp"

#include <nanobind/eigen/dense.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <new>
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

// A Python function of a tuple of states that returns a LevelData; what it raises passes through the core.
struct PythonBuilder {
    nb::object function;

    LevelData operator()(const Key& key) const {
        const nb::gil_scoped_acquire acquired;
        return nb::cast<const LevelData&>(function(nb::tuple(nb::cast(key))));
    }
};

// The builder mostly refers to the object that holds the levels: the garbage collector has to see it.
int visit_levels(PyObject* self, visitproc visit, void* arg) {
    Py_VISIT(Py_TYPE(self));
    if (!nb::inst_ready(self)) return 0;
    const auto* builder = nb::inst_ptr<Levels>(self)->builder().target<PythonBuilder>();
    if (builder != nullptr) Py_VISIT(builder->function.ptr());
    return 0;
}

int clear_levels(PyObject* self) {
    if (nb::inst_ready(self)) nb::inst_ptr<Levels>(self)->set_builder({});
    return 0;
}

PyType_Slot levels_slots[] = {{Py_tp_traverse, reinterpret_cast<void*>(visit_levels)},
                              {Py_tp_clear, reinterpret_cast<void*>(clear_levels)},
                              {0, nullptr}};

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

int visit_held_levels(PyObject* self, visitproc visit, void* arg) {
    const int status = visit_levels(self, visit, arg);
    if (status != 0 || !nb::inst_ready(self)) return status;
    const HeldLevels& levels = *nb::inst_ptr<HeldLevels>(self);
    if (const auto* forces = levels.forces().target<PythonForces>()) Py_VISIT(forces->function.ptr());
    if (!levels.inertia()) return 0;
    if (const auto* mobility = levels.inertia()->mobility.target<PythonMobility>()) Py_VISIT(mobility->function.ptr());
    if (const auto* map = levels.inertia()->velocity_map.target<PythonVelocityMap>()) Py_VISIT(map->function.ptr());
    return 0;
}

int clear_held_levels(PyObject* self) {
    if (nb::inst_ready(self)) nb::inst_ptr<HeldLevels>(self)->set_forces({}, std::nullopt);
    return clear_levels(self);
}

PyType_Slot held_levels_slots[] = {{Py_tp_traverse, reinterpret_cast<void*>(visit_held_levels)},
                                   {Py_tp_clear, reinterpret_cast<void*>(clear_held_levels)},
                                   {0, nullptr}};

void bind_held_levels(nb::module_& module) {
    nb::class_<HeldLevels, Levels>(module, "HeldLevels", nb::type_slots(held_levels_slots),
                                   "The levels of a model under constant forces that others hold for a step.")
        .def(
            "__init__",
            [](HeldLevels* self, std::shared_ptr<Model> model, std::shared_ptr<Excitation> excitation,
               nb::callable build) {
                new (self) HeldLevels(std::move(model), std::move(excitation), PythonBuilder{std::move(build)});
            },
            "model"_a, "excitation"_a, "builder"_a)
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

void make_data(LevelData* self, Key key, std::vector<int> links, Vector squares, Vector computed,
               Matrix damping_matrix, Matrix coupling, Matrix damping, Matrix modes, Matrix bending,
               Vector configuration, Vector drive,
               Vector static_drive, Vector load, double strain, double stored, Matrix gap_rows, Vector gap_constants,
               Matrix velocity_rows, Matrix force_rows, Matrix force_velocity_rows, Vector forces,
               Matrix channel_force, Matrix channel_force_rate, Matrix channel_shapes, Matrix carried,
               std::optional<Matrix> mobility, double duration) {
    new (self) LevelData{std::move(key),           std::move(links),
                         std::move(squares),       std::move(computed),
                         std::move(damping_matrix), std::move(coupling),
                         std::move(damping),       std::move(modes),
                         std::move(bending),
                         std::move(configuration), std::move(drive),
                         std::move(static_drive),  std::move(load),
                         strain,                   stored,
                         std::move(gap_rows),      std::move(gap_constants),
                         std::move(velocity_rows), std::move(force_rows),
                         std::move(force_velocity_rows), std::move(forces),
                         std::move(channel_force), std::move(channel_force_rate),
                         std::move(channel_shapes), std::move(carried),
                         std::move(mobility),      duration};
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
    nb::class_<LevelData>(module, "LevelData", "What levels/ computes of a level, in base coordinates and in xi.")
        .def("__init__", make_data, nb::kw_only(), "key"_a, "links"_a, "squares"_a, "computed"_a, "damping_matrix"_a,
             "coupling"_a, "damping"_a, "modes"_a, "bending"_a, "configuration"_a, "drive"_a, "static_drive"_a, "load"_a,
             "strain"_a,
             "stored"_a, "gap_rows"_a, "gap_constants"_a, "velocity_rows"_a, "force_rows"_a, "force_velocity_rows"_a,
             "forces"_a, "channel_force"_a, "channel_force_rate"_a, "channel_shapes"_a, "carried"_a,
             "mobility"_a = nb::none(), "duration"_a);
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
        .def_prop_ro("gap_rows", [](const Level& level) { return Matrix(level.data().gap_rows); })
        .def_prop_ro("gap_constants", [](const Level& level) { return Vector(level.data().gap_constants); })
        .def_prop_ro("velocity_rows", [](const Level& level) { return Matrix(level.data().velocity_rows); })
        .def_prop_ro("displacement_acceleration", &Level::displacement_acceleration, nb::rv_policy::copy)
        .def_prop_ro("velocity_acceleration", &Level::velocity_acceleration, nb::rv_policy::copy)
        .def_prop_ro("constant_acceleration", &Level::constant_acceleration, nb::rv_policy::copy)
        .def_prop_ro("drives_free_modes", &Level::drives_free_modes)
        .def_prop_ro("guards", &Level::guards, nb::rv_policy::copy)
        .def("first_guard", &Level::first_guard, "element"_a)
        .def("opening", &Level::opening, "element"_a, nb::rv_policy::reference_internal)
        .def_prop_ro("potential", &Level::potential, nb::rv_policy::reference_internal)
        .def_prop_ro("patterns", &Level::patterns, nb::rv_policy::copy)
        .def_prop_ro("carried", &Level::carried, nb::rv_policy::copy)
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
        .def_prop_ro("matrix", [](const Transition& transition) { return Matrix(transition.matrix); })
        .def_prop_ro("velocity_matrix", [](const Transition& transition) { return Matrix(transition.velocity_matrix); })
        .def_prop_ro("offset", [](const Transition& transition) { return Vector(transition.offset); })
        .def_prop_ro("terms", [](const Transition& transition) { return transition.terms; })
        .def_prop_ro("start_sizes", [](const Transition& transition) { return Matrix(transition.start_sizes); });
    nb::class_<Levels>(module, "Levels", nb::type_slots(levels_slots),
                       "The levels of a model under its loads, built on first use by a function of the states.")
        .def(
            "__init__",
            [](Levels* self, std::shared_ptr<Model> model, std::shared_ptr<Excitation> excitation, nb::callable build) {
                new (self) Levels(std::move(model), std::move(excitation), PythonBuilder{std::move(build)});
            },
            "model"_a, "excitation"_a, "builder"_a)
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
