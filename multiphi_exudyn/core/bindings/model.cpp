// Bindings of model.hpp and excitation.hpp: a model and its loads are made from Python, once, and never change.
#include "bindings/bindings.hpp"

#include <nanobind/eigen/dense.h>
#include <nanobind/stl/complex.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <limits>
#include <memory>
#include <new>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "excitation.hpp"
#include "modal_levels.hpp"
#include "model.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace multiphi::bindings {

namespace {

using Shares = std::vector<std::tuple<int, double, double, double>>;      // link, gap, velocity, force
using Functions = std::vector<std::tuple<Vector, ComplexVector, ComplexMatrix>>;  // breaks, rates, coefficients

void make_guard(GuardForm* self, int target, Rule rule, double constant, const Shares& shares,
                const std::optional<std::tuple<int, int, int>>& by_velocity) {
    new (self) GuardForm{target, rule, constant, {}, std::nullopt};
    for (const auto& [link, gap, velocity, force] : shares) self->shares.push_back({link, gap, velocity, force});
    if (by_velocity) {
        const auto& [link, forward, backward] = *by_velocity;
        self->by_velocity = {link, forward, backward};
    }
}

void make_state(ElementState* self, std::vector<GuardForm> guards, std::vector<int> links, double force,
                double stretch, const std::optional<std::tuple<int, double>>& ratio) {
    new (self) ElementState{std::move(guards), std::move(links), force, stretch, std::nullopt};
    if (ratio) self->ratio = {std::get<0>(*ratio), std::get<1>(*ratio)};
}

void make_element(Element* self, Kind kind, std::vector<int> links, std::vector<ElementState> states, double stiffness,
                  double restitution, double limit, double static_limit, double friction, double static_friction,
                  const std::tuple<int, int, int>& knots, const std::tuple<int, int, double, double>& stick) {
    new (self) Element{kind, std::move(links), std::move(states), stiffness, restitution, limit, static_limit, friction,
                       static_friction, {}, {}};
    self->knots = {std::get<0>(knots), std::get<1>(knots), std::get<2>(knots)};
    self->stick = {std::get<0>(stick), std::get<1>(stick), std::get<2>(stick), std::get<3>(stick)};
}

using MeasuredModes = std::vector<std::tuple<std::vector<int>, std::optional<Vector>, std::optional<Vector>>>;

void make_base(Base* self, Vector squares, int rigid_body_modes, Matrix damping, Matrix directions,
               Matrix force_directions, Vector stiffnesses, Vector dampings, Vector preload,
               double energy_offset, std::vector<int> held, std::vector<int> oblique, std::vector<int> residual,
               bool general, std::vector<int> parallel, Matrix points, std::vector<std::string> names, std::vector<std::string> labels) {
    new (self) Base{};
    self->squares = std::move(squares);
    self->rigid_body_modes = rigid_body_modes;
    self->damping = std::move(damping);
    self->directions = std::move(directions);
    self->force_directions = std::move(force_directions);
    self->stiffnesses = std::move(stiffnesses);
    self->dampings = std::move(dampings);
    self->preload = std::move(preload);
    self->energy_offset = energy_offset;
    self->held = std::move(held);
    self->oblique = std::move(oblique);
    self->residual = std::move(residual);
    self->general = general;
    self->parallel = std::move(parallel);
    self->points = std::move(points);
    self->names = std::move(names);
    self->labels = std::move(labels);
    self->prepare();
}

void make_modal_levels(ModalLevels* self, std::shared_ptr<Base> base, std::optional<int> most, double highest,
                       const MeasuredModes& measured) {
    KeptModes kept{most.value_or(std::numeric_limits<int>::max()), highest, {}};
    for (const auto& [links, frequencies, ratios] : measured) kept.measured[links] = {frequencies, ratios};
    new (self) ModalLevels(std::move(base), std::move(kept));
}

void make_excitation(Excitation* self, Vector static_load, Matrix patterns, Matrix stops, const Functions& functions,
                     double start, double until, double highest_frequency, bool is_isolated, std::vector<int> rate_of,
                     int steady) {
    std::vector<TimeFunction> given;
    for (const auto& [breaks, rates, coefficients] : functions)
        given.push_back({{breaks.begin(), breaks.end()}, {rates.begin(), rates.end()}, coefficients});
    const int prescribed = static_cast<int>(given.size());
    new (self) Excitation{std::move(static_load), std::move(patterns), std::move(stops), prescribed,
                          highest_frequency, is_isolated, std::move(rate_of), steady,
                          Intervals(std::move(given), start, until)};
}

void bind_elements(nb::module_& module) {
    nb::enum_<Kind>(module, "Kind")
        .value("compliant", Kind::compliant)
        .value("rigid", Kind::rigid)
        .value("viscous", Kind::viscous)
        .value("bounded", Kind::bounded)
        .value("sliding", Kind::sliding);
    nb::enum_<Rule>(module, "Rule", "What happens to a guard whose signal is negative after changes of others.")
        .value("may_recover", Rule::may_recover)
        .value("never_recovers", Rule::never_recovers)
        .value("always_taken", Rule::always_taken)
        .value("taken_once", Rule::taken_once)
        .value("taken_falling", Rule::taken_falling);
    nb::class_<GuardForm>(module, "GuardForm", "shares: (link, gap, velocity, force), links among all links.")
        .def("__init__", make_guard, nb::kw_only(), "target"_a, "rule"_a, "constant"_a, "shares"_a,
             "by_velocity"_a = nb::none());
    nb::class_<ElementState>(module, "ElementState")
        .def("__init__", make_state, nb::kw_only(), "guards"_a, "links"_a, "force"_a, "stretch"_a,
             "ratio"_a = nb::none());
    nb::class_<Element>(module, "Element", "knots: (first link, above, below); stick: (state, link, spring, drop).")
        .def("__init__", make_element, nb::kw_only(), "kind"_a, "links"_a, "states"_a, "stiffness"_a, "restitution"_a,
             "limit"_a, "static_limit"_a, "friction"_a, "static_friction"_a, "knots"_a, "stick"_a);
}

void bind_inputs(nb::module_& module) {
    nb::class_<Inputs>(module, "Inputs", "The channels that are functions of time at an instant.")
        .def(nb::init<const Excitation&>(), "excitation"_a, nb::keep_alive<1, 2>())
        .def("set", &Inputs::set, "interval"_a, "age"_a, "time"_a, "until"_a)
        .def("advance", &Inputs::advance, "delay"_a, "time"_a, "until"_a)
        .def_prop_ro("interval", &Inputs::interval)
        .def_prop_ro("interval_end", &Inputs::interval_end)
        .def_prop_ro("age", &Inputs::age)
        .def_prop_ro("horizon", &Inputs::horizon)
        .def_prop_ro("values", &Inputs::values, nb::rv_policy::copy)
        .def_prop_ro("rates", &Inputs::rates, nb::rv_policy::copy)
        .def_prop_ro("accelerations", &Inputs::accelerations, nb::rv_policy::copy)
        .def_prop_ro("value_sizes", &Inputs::value_sizes, nb::rv_policy::copy)
        .def_prop_ro("rate_sizes", &Inputs::rate_sizes, nb::rv_policy::copy)
        .def_prop_ro("acceleration_sizes", &Inputs::acceleration_sizes, nb::rv_policy::copy)
        .def_prop_ro("terms", [](const Inputs& inputs) {
            std::vector<std::tuple<Complex, ComplexMatrix>> result;
            for (const Term& term : inputs.terms()) result.emplace_back(term.rate, term.coefficients);
            return result;
        });
}

}  // namespace

void bind_model(nb::module_& module) {
    bind_elements(module);
    nb::class_<Base>(module, "Base", "The coordinates that all levels share, and the links in them.")
        .def("__init__", make_base, nb::kw_only(), "squares"_a, "rigid_body_modes"_a, "damping"_a, "directions"_a,
             "force_directions"_a, "stiffnesses"_a, "dampings"_a, "preload"_a, "energy_offset"_a, "held"_a,
             "oblique"_a, "residual"_a, "general"_a, "parallel"_a, "points"_a, "names"_a, "labels"_a)
        .def("are_independent", &Base::are_independent, "rigid"_a)
        .def_prop_ro("orientation", [](const Base& base) { return Vector(base.orientation); });
    module.def(
        "static_response",
        [](const Base& base, const std::vector<int>& closed, const Vector& gaps, const Vector& load) {
            Deflection found = static_deflection(base, closed, load, gaps);
            return std::make_pair(std::move(found.forces), std::move(found.configuration));
        },
        "base"_a, "closed"_a, "gaps"_a, "load"_a,
        "Forces (k,) of closed links and y (m,) in response to their gaps (k,) and a load (m,), without friction.");
    nb::class_<ModalLevel>(module, "ModalLevel", "The modes of a set of closed links, without friction.")
        .def_prop_ro("links", [](const ModalLevel& level) { return nb::tuple(nb::cast(level.links())); })
        .def_prop_ro("kept_beyond", &ModalLevel::kept_beyond)
        .def_prop_ro("vibrates", &ModalLevel::vibrates)
        .def_prop_ro("squares", [](const ModalLevel& level) { return level.squares; })
        .def_prop_ro("computed", [](const ModalLevel& level) { return level.computed; })
        .def_prop_ro("shapes", [](const ModalLevel& level) { return level.shapes; })
        .def_prop_ro("inertial", [](const ModalLevel& level) { return level.inertial; })
        .def_prop_ro("damping", [](const ModalLevel& level) { return level.damping; })
        .def_prop_ro("gaps", [](const ModalLevel& level) { return level.gaps; })
        .def_prop_ro("following", [](const ModalLevel& level) { return level.following; })
        .def("static_shares", &ModalLevel::static_shares, "count"_a,
             "By the first link of each spring, the share of its flexibility that modes beyond the first ones have.");
    nb::class_<MovingLevel>(module, "MovingLevel", "The modes of a set of closed links, with friction of those that slide.")
        .def(nb::init<const Base&, std::vector<int>, const KeptModes&>(), "base"_a, "links"_a, "kept"_a,
             nb::keep_alive<1, 2>())
        .def_prop_ro("modal", [](const MovingLevel& level) -> const ModalLevel& { return level.modal; },
                     nb::rv_policy::reference_internal)
        .def_prop_ro("forces", [](const MovingLevel& level) { return level.forces(); })
        .def_prop_ro("force_rates", [](const MovingLevel& level) { return level.force_rates(); })
        .def_prop_ro("coupling", &MovingLevel::coupling)
        .def_prop_ro("damping_matrix", &MovingLevel::damping_matrix)
        .def("asymptotic", &MovingLevel::asymptotic, "load"_a, "gaps"_a)
        .def(
            "deflection",
            [](const MovingLevel& level, const Vector& load, const Vector& gaps) {
                Deflection found = level.deflection(load, gaps);
                return std::make_pair(std::move(found.forces), std::move(found.configuration));
            },
            "load"_a, "gaps"_a, "Forces (k,) of the closed links and y (m,) in response to a load (m,) and gaps (k,).");
    nb::class_<KeptModes>(module, "KeptModes", "Which modes levels keep: the lowest ones, up to a frequency [Hz].")
        .def(
            "__init__",
            [](KeptModes* self, std::optional<int> most, double highest) {
                new (self) KeptModes{most.value_or(std::numeric_limits<int>::max()), highest, {}};
            },
            "most"_a = nb::none(), "highest"_a = std::numeric_limits<double>::infinity());
    nb::class_<Asymptotic>(module, "Asymptotic", "Static response of a level to gaps and a static load.")
        .def_prop_ro("configuration", [](const Asymptotic& rest) { return rest.configuration; })
        .def_prop_ro("gaps", [](const Asymptotic& rest) { return rest.gaps; })
        .def_prop_ro("forces", [](const Asymptotic& rest) { return rest.forces; })
        .def_prop_ro("drive", [](const Asymptotic& rest) { return rest.drive; })
        .def_prop_ro("load", [](const Asymptotic& rest) { return rest.load; })
        .def_prop_ro("strain", [](const Asymptotic& rest) { return rest.strain; })
        .def_prop_ro("potential", [](const Asymptotic& rest) { return rest.strain - rest.load.dot(rest.configuration); });
    nb::class_<ResidualBoundary>(module, "ResidualBoundary", "Residual contacts, and what their forces bend beside modes.")
        .def_prop_ro("flexibility", [](const ResidualBoundary& boundary) { return boundary.flexibility; })
        .def_prop_ro("compliances", [](const ResidualBoundary& boundary) { return boundary.compliances; });
    nb::class_<ModalLevels>(module, "ModalLevels", "The levels of a model, built on first use.")
        .def("__init__", make_modal_levels, "base"_a, "most"_a, "highest"_a, "measured"_a,
             "most, highest: which modes levels keep. measured: frequencies [Hz] and damping ratios by closed links.")
        .def("level",
             [](ModalLevels& levels, const std::vector<int>& links) {
                 return std::const_pointer_cast<MovingLevel>(levels.level(links));
             },
             "links"_a)
        .def("boundary",
             [](ModalLevels& levels, const std::vector<int>& host) {
                 return std::const_pointer_cast<ResidualBoundary>(levels.boundary(host));
             },
             "host"_a)
        .def("set_most", &ModalLevels::set_most, "most"_a)
        .def_prop_ro("built", &ModalLevels::built)
        .def_prop_ro("count", &ModalLevels::count)
        .def_prop_ro("highest_frequency", &ModalLevels::highest_frequency);
    nb::class_<Model>(module, "Model", "The elements, and the levels that they have.")
        .def(nb::init<std::shared_ptr<ModalLevels>, Vector, std::vector<Element>, std::vector<int>, bool, int>(),
             nb::kw_only(), "levels"_a, "gaps"_a, "elements"_a, "roughest_first"_a, "is_complete"_a, "knots"_a)
        .def_prop_ro("size", &Model::size)
        .def_prop_ro("modes", [](const Model& model) { return model.base.modes(); })
        .def_prop_ro("unit_directions", [](const Model& model) { return Matrix(model.unit_directions); })
        .def_prop_ro("is_complete", [](const Model& model) { return model.is_complete; });
    nb::class_<Excitation>(module, "Excitation", "functions: (breaks, rates, coefficients) of the prescribed channels.")
        .def("__init__", make_excitation, nb::kw_only(), "static_load"_a, "patterns"_a, "stops"_a, "functions"_a,
             "start"_a, "until"_a, "highest_frequency"_a, "is_isolated"_a, "rate_of"_a, "steady"_a)
        .def_prop_ro("channels", &Excitation::channels)
        .def_prop_ro("prescribed", [](const Excitation& excitation) { return excitation.prescribed; })
        .def_prop_ro("intervals", [](const Excitation& excitation) { return excitation.intervals.count(); })
        .def("interval_at", [](const Excitation& excitation, double time) { return excitation.intervals.at(time); })
        .def("interval_start",
             [](const Excitation& excitation, int interval) { return excitation.intervals.start(interval); })
        .def("interval_end",
             [](const Excitation& excitation, int interval) { return excitation.intervals.end(interval); });
    bind_inputs(module);
}

}  // namespace multiphi::bindings
