// Bindings of model.hpp and excitation.hpp: a model and its loads are made from Python, once, and never change.
#include "bindings/bindings.hpp"

#include <nanobind/eigen/dense.h>
#include <nanobind/stl/complex.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <new>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "excitation.hpp"
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

void make_model(Model* self, std::vector<Element> elements, Vector squares, Matrix damping, Matrix directions,
                Matrix force_directions, Vector gaps, Vector stiffnesses, Vector dampings, Vector preload,
                double energy_offset, std::vector<int> held, std::vector<int> oblique, bool general,
                std::vector<int> residual, std::vector<int> roughest_first, bool is_complete, int knots) {
    new (self) Model{};
    self->base = Base{std::move(squares),     std::move(damping),  std::move(directions), std::move(force_directions),
                      std::move(gaps),        std::move(stiffnesses), std::move(dampings), std::move(preload),
                      energy_offset,          std::move(held),     std::move(oblique),    std::move(residual), general};
    self->elements = std::move(elements);
    self->roughest_first = std::move(roughest_first);
    self->is_complete = is_complete;
    self->knots = knots;
    self->prepare();
}

void make_excitation(Excitation* self, Vector static_load, Matrix patterns, Matrix stops, const Functions& functions,
                     double start, double until, double highest_frequency, bool is_isolated) {
    std::vector<TimeFunction> given;
    for (const auto& [breaks, rates, coefficients] : functions)
        given.push_back({{breaks.begin(), breaks.end()}, {rates.begin(), rates.end()}, coefficients});
    const int prescribed = static_cast<int>(given.size());
    new (self) Excitation{std::move(static_load), std::move(patterns), std::move(stops), prescribed,
                          highest_frequency, is_isolated, Intervals(std::move(given), start, until)};
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
    nb::class_<Model>(module, "Model", "The coordinates that all levels share, and the elements.")
        .def("__init__", make_model, nb::kw_only(), "elements"_a, "squares"_a, "damping"_a, "directions"_a,
             "force_directions"_a, "gaps"_a, "stiffnesses"_a, "dampings"_a, "preload"_a, "energy_offset"_a, "held"_a,
             "oblique"_a, "general"_a, "residual"_a, "roughest_first"_a, "is_complete"_a, "knots"_a)
        .def_prop_ro("size", &Model::size)
        .def_prop_ro("modes", [](const Model& model) { return model.base.modes(); })
        .def_prop_ro("unit_directions", [](const Model& model) { return Matrix(model.unit_directions); })
        .def_prop_ro("is_complete", [](const Model& model) { return model.is_complete; });
    nb::class_<Excitation>(module, "Excitation", "functions: (breaks, rates, coefficients) of the prescribed channels.")
        .def("__init__", make_excitation, nb::kw_only(), "static_load"_a, "patterns"_a, "stops"_a, "functions"_a,
             "start"_a, "until"_a, "highest_frequency"_a, "is_isolated"_a)
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
