// Bindings of run.hpp and trajectory.hpp: runs from event to event, and their records as arrays.
#include "bindings/run.hpp"

#include <nanobind/eigen/dense.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <cstring>
#include <map>
#include <memory>
#include <optional>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "batch.hpp"
#include "failure.hpp"
#include "run.hpp"
#include "trajectory.hpp"
#include "truncation.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace multiphi::bindings {

namespace {

// An array of its own with one value of every item.
template <typename Value, typename Items, typename Get>
nb::object column(const Items& items, const Get& get) {
    auto* values = new std::vector<Value>();
    values->reserve(items.size());
    for (const auto& item : items) values->push_back(get(item));
    const nb::capsule owner(values, [](void* kept) noexcept { delete static_cast<std::vector<Value>*>(kept); });
    return nb::cast(nb::ndarray<nb::numpy, Value, nb::ndim<1>>(values->data(), {values->size()}, owner));
}

std::array<double, 6> as_array(const Loss& loss) {
    return {loss.impact, loss.truncation_kinetic, loss.truncation_strain, loss.stop_work, loss.damping, loss.friction};
}

// Losses (k, 6) of all events.
nb::object losses(const Trajectory& trajectory) {
    auto* values = new std::vector<double>();
    values->reserve(6 * trajectory.events.size());
    for (const Event& event : trajectory.events)
        for (const double part : as_array(event.loss)) values->push_back(part);
    const nb::capsule owner(values, [](void* kept) noexcept { delete static_cast<std::vector<double>*>(kept); });
    return nb::cast(
        nb::ndarray<nb::numpy, double, nb::ndim<2>>(values->data(), {trajectory.events.size(), std::size_t{6}}, owner));
}

// The numbers of a trajectory as bytes, for a copy in another process of the same machine.
template <typename Value>
nb::bytes bytes_of(const Value* values, std::size_t count) {
    static_assert(std::is_trivially_copyable_v<Value>);
    return nb::bytes(reinterpret_cast<const char*>(values), count * sizeof(Value));
}

template <typename Value>
void from_bytes(const nb::bytes& bytes, Value* values) {
    std::memcpy(static_cast<void*>(values), bytes.c_str(), bytes.size());
}

template <typename Value>
void from_bytes(const nb::bytes& bytes, std::vector<Value>& values) {
    values.resize(bytes.size() / sizeof(Value));
    from_bytes(bytes, values.data());
}

// Lets Python copy a plain struct, to another process too.
template <typename Struct>
void make_picklable(nb::class_<Struct>& bound) {
    bound.def("__copy__", [](const Struct& self) { return Struct(self); })
        .def("__getstate__", [](const Struct& self) { return bytes_of(&self, 1); })
        .def("__setstate__", [](Struct& self, const nb::bytes& state) {
            new (&self) Struct();
            from_bytes(state, &self);
        });
}

using Saved = std::tuple<std::vector<Key>, std::vector<int>, std::vector<int>, std::vector<int>, nb::bytes, nb::bytes,
                         nb::bytes, nb::bytes, nb::bytes, nb::bytes, nb::bytes, long, int>;

Saved saved(const Trajectory& t) {
    return {t.keys, t.widths, t.guards, t.left_out, bytes_of(t.instants.data(), t.instants.size()),
            bytes_of(t.segments.data(), t.segments.size()), bytes_of(t.coordinates.data(), t.coordinates.size()),
            bytes_of(t.phases.data(), t.phases.size()), bytes_of(t.events.data(), t.events.size()),
            bytes_of(&t.ledger, 1), bytes_of(&t.truncation, 1), t.evaluations, t.transitions};
}

void restore(Trajectory& self, const Saved& state) {
    Trajectory* t = new (&self) Trajectory();
    std::tie(t->keys, t->widths, t->guards, t->left_out, std::ignore, std::ignore, std::ignore, std::ignore, std::ignore,
             std::ignore, std::ignore, t->evaluations, t->transitions) = state;
    from_bytes(std::get<4>(state), t->instants);
    from_bytes(std::get<5>(state), t->segments);
    from_bytes(std::get<6>(state), t->coordinates);
    from_bytes(std::get<7>(state), t->phases);
    from_bytes(std::get<8>(state), t->events);
    from_bytes(std::get<9>(state), &t->ledger);
    from_bytes(std::get<10>(state), &t->truncation);
}

void bind_trajectory(nb::module_& module) {
    nb::class_<Works> works(module, "Works", "Works of damping, of varying loads and of friction [J].");
    make_picklable(works);
    works.def_ro("damping", &Works::damping)
        .def_ro("varying", &Works::varying)
        .def_ro("friction", &Works::friction);
    nb::class_<Ledger> ledger(module, "Ledger", "Entries of the energy ledger [J] up to the end of a trajectory.");
    make_picklable(ledger);
    ledger.def_prop_ro("at_start", [](const Ledger& ledger) { return as_array(ledger.at_start); })
        .def_prop_ro("at_events", [](const Ledger& ledger) { return as_array(ledger.at_events); })
        .def_ro("works", &Ledger::works)
        .def_ro("load_work", &Ledger::load_work)
        .def_ro("start_energy", &Ledger::start_energy)
        .def_rw("start_potential", &Ledger::start_potential)
        .def_ro("end_energy", &Ledger::end_energy)
        .def_ro("is_balanced", &Ledger::is_balanced);
    nb::class_<Truncation> truncation(module, "Truncation",
                                      "What truncation did to a run; estimates are nan where not known.");
    make_picklable(truncation);
    truncation.def_rw("defects", &Truncation::defects)
        .def_ro("truncated_energy", &Truncation::truncated_energy)
        .def_rw("start_square", &Truncation::start_square)
        .def_rw("mean_square", &Truncation::mean_square)
        .def_rw("largest_energy", &Truncation::largest_energy)
        .def_ro("is_isolated", &Truncation::is_isolated)
        .def_ro("energy_share", &Truncation::energy_share)
        .def_ro("motion", &Truncation::motion)
        .def("estimate", estimate_truncation, "ledger"_a, "threshold"_a,
             "Set the estimates from the other numbers; threshold: of the indicator for a warning.");
    module.def("lost_share", lost_share, "lost"_a, "largest"_a,
               "Share of energy lost in the largest energy of a run, zero where it is too small for a warning.");
    module.def("indicator", indicator, "defects"_a, "mean_square"_a,
               "Indicator of the motion of a sum of defects and the mean of |y|^2.");
    module.attr("IMMOVABLE") = impact::immovable;
    module.def("is_balanced", is_balanced, "ledger"_a, "energy"_a,
               "Whether a ledger is closed and only takes energy; energy [J]: total of the last state, less static loads.");
    module.attr("OPEN_LEDGER") = open_ledger;
    module.attr("MOTION_THRESHOLD") = motion_threshold;
    module.attr("MOTION_SAMPLES") = MotionSize::samples;
    nb::class_<Trajectory>(module, "Trajectory", "The record of a run, segment by segment and event by event.")
        .def_ro("keys", &Trajectory::keys, "states of the elements of every level visited")
        .def_ro("widths", &Trajectory::widths)
        .def_prop_ro("instants",
                     [](const Trajectory& t) { return column<double>(t.instants, [](double time) { return time; }); })
        .def_prop_ro("levels", [](const Trajectory& t) { return column<int>(t.segments, [](const Segment& s) { return s.level; }); })
        .def_prop_ro("intervals",
                     [](const Trajectory& t) { return column<int>(t.segments, [](const Segment& s) { return s.interval; }); })
        .def_prop_ro("ages",
                     [](const Trajectory& t) { return column<double>(t.segments, [](const Segment& s) { return s.age; }); })
        .def_prop_ro("horizons",
                     [](const Trajectory& t) { return column<double>(t.segments, [](const Segment& s) { return s.horizon; }); })
        .def_prop_ro("entry_works",
                     [](const Trajectory& t) { return column<double>(t.segments, [](const Segment& s) { return s.entry_work; }); })
        .def_prop_ro("armed_after",
                     [](const Trajectory& t) { return column<double>(t.segments, [](const Segment& s) { return s.armed_after; }); })
        .def_prop_ro("all_armed", [](const Trajectory& t) {
            return column<int>(t.segments, [](const Segment& s) { return static_cast<int>(s.phases < 0); });
        })
        .def("start", [](const Trajectory& t, int segment) {
            const Segment& s = t.segments.at(static_cast<std::size_t>(segment));
            const int n = t.widths[static_cast<std::size_t>(s.level)];
            const double* x = t.coordinates.data() + s.coordinates;
            return std::pair<Vector, Vector>(Vector::Map(x, n), Vector::Map(x + n, n));
        }, "segment"_a, "xi, xi' at the start of a segment")
        .def("start_phases", [](const Trajectory& t, int segment) {
            const Segment& s = t.segments.at(static_cast<std::size_t>(segment));
            const auto count = t.guards[static_cast<std::size_t>(s.level)];
            if (s.phases < 0) return std::vector<Phase>(count, Phase::armed);
            return std::vector<Phase>(t.phases.begin() + s.phases, t.phases.begin() + s.phases + count);
        }, "segment"_a, "phases of the guards at the start of a segment")
        .def_prop_ro("event_times",
                     [](const Trajectory& t) { return column<double>(t.events, [](const Event& e) { return e.time; }); })
        .def_prop_ro("event_elements",
                     [](const Trajectory& t) { return column<int>(t.events, [](const Event& e) { return e.change.element; }); })
        .def_prop_ro("event_entered",
                     [](const Trajectory& t) { return column<int>(t.events, [](const Event& e) { return e.change.entered; }); })
        .def_prop_ro("event_left",
                     [](const Trajectory& t) { return column<int>(t.events, [](const Event& e) { return e.change.left; }); })
        .def_prop_ro("event_impulses",
                     [](const Trajectory& t) { return column<double>(t.events, [](const Event& e) { return e.change.impulse; }); })
        .def_prop_ro("event_losses", losses)
        .def_ro("left_out", &Trajectory::left_out)
        .def_ro("ledger", &Trajectory::ledger)
        .def_ro("truncation", &Trajectory::truncation)
        .def_ro("evaluations", &Trajectory::evaluations)
        .def_ro("transitions", &Trajectory::transitions)
        .def_prop_ro("memory", &Trajectory::bytes)
        .def("__getstate__", saved)
        .def("__setstate__", restore);
}

}  // namespace

void bind_run(nb::module_& module) {
    nb::enum_<Phase>(module, "Phase", "What a guard waits for.")
        .value("armed", Phase::armed)
        .value("recovering", Phase::recovering)
        .value("refused", Phase::refused)
        .value("held_back", Phase::held_back)
        .value("landing", Phase::landing);
    nb::class_<Failure>(module, "Failure", "Why a run ended before its time.")
        .def_ro("cause", &Failure::cause)
        .def_ro("elements", &Failure::elements)
        .def_ro("details", &Failure::details);
    nb::class_<Start>(module, "Start", "Initial conditions of a run in base coordinates.")
        .def(nb::init<Vector, Vector, Vector, Key, double>(), "displacement"_a, "velocity"_a, "held"_a, "states"_a,
             "spring_energy"_a);
    nb::class_<FinalState>(module, "FinalState", "Where a run ends, so that another one may go on from there.")
        .def("__init__",
             [](FinalState* self, double time, Key key, Vector displacement, Vector velocity, std::vector<Phase> phases,
                int interval, double age) {
                 new (self) FinalState{time, std::move(key), std::move(displacement), std::move(velocity),
                                       std::move(phases), interval, age};
             },
             "time"_a, "key"_a, "displacement"_a, "velocity"_a, "phases"_a, "interval"_a = 0, "age"_a = 0.0)
        .def_ro("time", &FinalState::time)
        .def_ro("key", &FinalState::key)
        .def_ro("displacement", &FinalState::displacement)
        .def_ro("velocity", &FinalState::velocity)
        .def_ro("phases", &FinalState::phases)
        .def_ro("interval", &FinalState::interval)
        .def_ro("age", &FinalState::age);
    nb::class_<StepState>(module, "StepState", "A state as the owner of held forces knows it, without them.")
        .def("__init__",
             [](StepState* self, Key key, Vector displacement, Vector velocity, std::vector<Phase> phases) {
                 new (self) StepState{std::move(key), std::move(displacement), std::move(velocity), std::move(phases)};
             },
             "key"_a, "displacement"_a, "velocity"_a, "phases"_a)
        .def_prop_ro("key", [](const StepState& state) { return nb::tuple(nb::cast(state.key)); })
        .def_ro("displacement", &StepState::displacement)
        .def_ro("velocity", &StepState::velocity)
        .def_ro("phases", &StepState::phases);
    module.attr("SHARED") = Change::shared;
    nb::class_<Chatter>(module, "Chatter", "The last decisions, among which chatter is looked for.");
    bind_trajectory(module);
    nb::class_<Run>(module, "Run", "A motion from event to event.")
        .def("__init__",
             [](Run* self, std::shared_ptr<Levels> levels, int window, double allowed, double time) {
                 new (self) Run(std::move(levels), Chatter(window, allowed), time);
             },
             "levels"_a, "window"_a, "allowed"_a, "time"_a = 0.0)
        .def("begin", &Run::begin, "start"_a)
        .def("go_on_from", &Run::go_on_from, "state"_a, "loads_differ"_a)
        .def("advance",
             [](Run& run, double end, bool stop_at_event) -> std::optional<Failure> {
                 const nb::gil_scoped_release released;
                 try {
                     run.advance(end, stop_at_event);
                 } catch (const NumericalFailure& failure) {
                     if (is_of_a_level(failure.cause())) throw;  // with its own sentence (bindings/failure.cpp)
                     return Failure{failure.cause(), failure.elements(), failure.details()};
                 }
                 return std::nullopt;
             },
             "end"_a, "stop_at_event"_a = false, "Advance to a time [s], or to the first event; a failure is returned.")
        .def_prop_ro("time", &Run::time)
        .def_prop_ro("has_started", &Run::has_started)
        .def_prop_ro("final_state", [](const Run& run) -> std::optional<FinalState> {
            if (!run.has_started()) return std::nullopt;
            return run.final_state();
        })
        .def_prop_ro("trajectory", &Run::shared_trajectory)
        .def_prop_rw("sums_works", nullptr, &Run::sum_works)
        .def_prop_rw("keeps_summary", nullptr, &Run::keep_summary)
        .def("begin_step", &Run::begin_step, "time"_a, "state"_a, nb::call_guard<nb::gil_scoped_release>(),
             "Begin anew at a state; the record so far is dropped.")
        .def_prop_ro("present", [](const Run& run) { return run.step_state(run.current()); })
        .def_prop_ro("reached", [](const Run& run) { return run.step_state(run.reached()); },
                     "the state right before the last decision, or that at the end")
        .def("limit_record", &Run::limit_record, "bytes"_a)
        .def_prop_rw("defects", [](Run& run) { return run.defects(); },
                     [](Run& run, double sum) { run.defects() = sum; }, "their sum so far, which may begin anew")
        .def_prop_rw("chatter", [](Run& run) { return Chatter(run.chatter()); },
                     [](Run& run, const Chatter& chatter) { run.chatter() = chatter; })
        .def("set_attached",
             [](Run& run, Matrix directions, double independence, const std::vector<int>& immovable) {
                 Flags flags(run.law().instant.asked.size(), 0);
                 for (const int element : immovable) flags.at(static_cast<std::size_t>(element)) = 1;
                 run.law().set_attached(std::move(directions), independence, std::move(flags));
             },
             "directions"_a, "independence"_a, "immovable"_a);
    nb::class_<BatchRun>(module, "BatchRun", "A run of a batch; one that is not complete is to be run alone.")
        .def_ro("trajectory", &BatchRun::trajectory)
        .def_ro("final_state", &BatchRun::final_state)
        .def_ro("is_complete", &BatchRun::is_complete);
    module.def(
        "run_batch",
        [](const std::vector<std::shared_ptr<Levels>>& levels, const std::vector<Start>& starts, int window,
           double allowed, double time, double end, int threads) {
            if (levels.size() != starts.size()) throw std::invalid_argument("levels: need those of every start");
            const nb::gil_scoped_release released;
            return run_batch(levels, starts, Chatter(window, allowed), time, end, threads);
        },
        "levels"_a, "starts"_a, "window"_a, "allowed"_a, "time"_a, "end"_a, "threads"_a,
        "Many runs on several threads, each in its levels from its start.");
    bind_coupled_step(module);
}

}  // namespace multiphi::bindings
