// Binding of the coupled step: a system of another solver is a Python object, whose methods evaluate its present state.
#include "bindings/run.hpp"

#include <nanobind/eigen/dense.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <new>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "coupled_step.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace multiphi::bindings {

namespace {

using View = nb::ndarray<double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

class PythonSystem : public SolverSystem {
  public:
    explicit PythonSystem(nb::handle system) : system_(system) {}

    SolverLevel level(const Key& key) override { return nb::cast<SolverLevel>(system_.attr("solver_level")(states(key))); }
    Vector forces() override { return nb::cast<Vector>(system_.attr("forces")()); }
    Matrix mass() override { return nb::cast<Matrix>(system_.attr("mass")()); }
    Matrix jacobian() override { return nb::cast<Matrix>(system_.attr("jacobian")()); }
    Vector constraint_accelerations() override {
        return nb::cast<Vector>(system_.attr("constraint_accelerations")());
    }
    void set_level(const Key& key, const Vector& held, const Vector& force) override {
        system_.attr("set_level")(states(key), held, force);
    }
    Vector own_force(const Key& key, double time) override {
        return nb::cast<Vector>(system_.attr("own_force")(states(key), time));
    }
    void check_attached(const std::vector<int>& coordinates) override { system_.attr("check_attached")(coordinates); }

  private:
    static nb::tuple states(const Key& key) { return nb::tuple(nb::cast(key)); }
    nb::handle system_;
};

// A coupled step with the arrays that it reads and writes.
struct WritingStep {
    View displacement, velocity, acceleration, multipliers;
    CoupledStep step;
};

using EventRow = std::tuple<double, int, int, int, double, std::array<double, 6>>;

std::vector<EventRow> taken_events(WritingStep& self) {
    std::vector<EventRow> rows;
    for (const Event& event : self.step.take_events()) {
        const Loss& loss = event.loss;
        rows.emplace_back(event.time, event.change.element, event.change.entered, event.change.left, event.change.impulse,
                          std::array<double, 6>{loss.impact, loss.truncation_kinetic, loss.truncation_strain,
                                                loss.stop_work, loss.damping, loss.friction});
    }
    return rows;
}

}  // namespace

void bind_coupled_step(nb::module_& module) {
    module.def("solve_constrained", solve_constrained, "mass"_a, "jacobian"_a, "forces"_a, "prescribed"_a,
               "a and mu of M a + C^T mu = f, C a = g; redundant constraints share mu.");
    nb::class_<AttachedParts>(module, "AttachedParts", "Masses and constraints attached to points of a body.")
        .def(nb::init<Matrix, Matrix, int, const Matrix&, const std::vector<int>&>(), "mass"_a, "jacobian"_a, "first"_a,
             "own_mass"_a, "points"_a)
        .def_ro("acts_on_body", &AttachedParts::acts_on_body)
        .def_ro("connected", &AttachedParts::connected)
        .def_ro("inertia", &AttachedParts::inertia)
        .def_ro("free", &AttachedParts::free);
    nb::class_<PointInertia>(module, "PointInertia", "Inertia attached to points of the structure.")
        .def(nb::init<const Matrix&, Matrix, Matrix>(), "mass"_a, "free"_a, "in_base"_a)
        .def("impedance", &PointInertia::impedance, "rows"_a, "X (m, m) for rows (m, r) of the points.");
    nb::class_<SolverLevel>(module, "SolverLevel", "A level as a solver integrates it, with the points of the body.")
        .def("__init__",
             [](SolverLevel* self, Matrix equation, Vector drive, Matrix rates, Matrix difference,
                Matrix velocity_inverse, Matrix physical, Matrix from_velocity, Matrix rows, Vector offset,
                Matrix held_offset, Matrix reactions, Vector push, std::vector<int> rubbing, Matrix rubbing_forces) {
                 new (self) SolverLevel{std::move(equation),         std::move(drive),       std::move(rates),
                                        std::move(difference),       std::move(velocity_inverse),
                                        std::move(physical),         std::move(from_velocity),
                                        std::move(rows),             std::move(offset),      std::move(held_offset),
                                        std::move(reactions),        std::move(push),        std::move(rubbing),
                                        std::move(rubbing_forces)};
             },
             nb::kw_only(), "equation"_a, "drive"_a, "rates"_a, "difference"_a, "velocity_inverse"_a, "physical"_a,
             "from_velocity"_a, "rows"_a, "offset"_a, "held_offset"_a, "reactions"_a, "push"_a, "rubbing"_a,
             "rubbing_forces"_a);
    nb::class_<RepeatedStep>(module, "RepeatedStep", "Result of a step that has been computed again.")
        .def_ro("state", &RepeatedStep::state)
        .def_ro("has_changed", &RepeatedStep::has_changed)
        .def_ro("largest_energy", &RepeatedStep::largest_energy)
        .def_ro("energy", &RepeatedStep::energy)
        .def_ro("driven", &RepeatedStep::driven)
        .def_ro("is_unresolved", &RepeatedStep::is_unresolved)
        .def_ro("event_time", &RepeatedStep::event_time);
    nb::class_<WritingStep>(module, "CoupledStep", "Computes steps of another solver again, exactly.")
        .def("__init__",
             [](WritingStep* self, std::shared_ptr<HeldLevels> levels, int window, double allowed, double time,
                View displacement, View velocity, View acceleration, View multipliers, int first,
                std::vector<int> points, std::vector<int> ties, Matrix in_base, bool has_varying_loads,
                bool has_friction, bool has_rigid) {
                 SolverPlaces places{displacement.data(), velocity.data(), acceleration.data(), multipliers.data(),
                                     static_cast<Index>(displacement.size()), static_cast<Index>(multipliers.size()),
                                     first, std::move(points), std::move(ties)};
                 const BodyKind kind{in_base.rows() > 0, has_varying_loads, has_rigid, has_friction};
                 new (self) WritingStep{
                     std::move(displacement), std::move(velocity), std::move(acceleration), std::move(multipliers),
                     CoupledStep(std::move(levels), Chatter(window, allowed), time, std::move(places), kind,
                                 std::move(in_base))};
             },
             nb::kw_only(), "levels"_a, "window"_a, "allowed"_a, "time"_a, "displacement"_a.noconvert(),
             "velocity"_a.noconvert(), "acceleration"_a.noconvert(), "multipliers"_a.noconvert(), "first"_a, "points"_a,
             "ties"_a, "in_base"_a, "has_varying_loads"_a, "has_friction"_a, "has_rigid"_a)
        .def("repeat",
             [](WritingStep& self, nb::handle system, double start, double end, const Vector& x_start,
                const StepState& state, double largest_energy, bool load_jumps) -> std::variant<RepeatedStep, Failure> {
                 PythonSystem evaluated(system);
                 try {
                     return self.step.repeat(evaluated, start, end, x_start, state, largest_energy, load_jumps);
                 } catch (const NumericalFailure& failure) {
                     if (is_of_a_level(failure.cause())) throw;
                     return Failure{failure.cause(), failure.elements(), failure.details()};
                 }
             },
             "system"_a, "start"_a, "end"_a, "x_start"_a, "state"_a, "largest_energy"_a, "load_jumps"_a,
             "Compute the step again whose end the system has reached, and write its result; a failure is returned.")
        .def("take_events", taken_events, "Time, element, states entered and left, impulse and losses of new events.")
        .def_prop_ro("time", [](const WritingStep& self) { return self.step.run().time(); })
        .def_prop_ro("key", [](const WritingStep& self) {
            return nb::tuple(nb::cast(self.step.run().current().level->key()));
        });
}

}  // namespace multiphi::bindings
