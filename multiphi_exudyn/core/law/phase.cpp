// Phases: what every guard of a state waits for (sentences 1, 5, 6, 9).
#include <algorithm>
#include <cmath>

#include "law/law.hpp"
#include "round_off.hpp"

namespace multiphi {

// A guard is armed where its signal is above zero, or zero and not falling. A negative one recovers if it rises and its rule
// lets it wait, else its request is refused.
Phase Law::phase_of(const State& state, const Guard& guard) {
    double mapped = 0.0;
    if (guard.rule == Rule::always_taken || guard.rule == Rule::never_recovers)
        mapped = mapped_size(state, guard.signal);  // a reaction, or what may not be negative by round-off
    const int value = signal_sign(state, guard.signal, mapped);
    if (value > 0) return Phase::armed;
    int rate = rate_sign(state, guard.signal, *inputs_);
    if (rate == 0) rate = first_derivative_sign(state, guard.signal, 2);
    if (value == 0 && rate >= 0) return Phase::armed;
    const bool recovers =
        guard.rule == Rule::may_recover || guard.rule == Rule::taken_once || guard.rule == Rule::taken_falling;
    return rate > 0 && recovers ? Phase::recovering : Phase::refused;
}

// The sign of a signal's first derivative, of an order from `since` on, that is not round-off of its terms on the motion.
int Law::first_derivative_sign(const State& state, const Signal& signal, int since) {
    motion_.begin(state, *inputs_);
    coefficients_.resize(motion_.size());
    sizes_.resize(motion_.size());
    motion_.signal(signal, coefficients_.data());
    motion_.signal_sizes(signal, sizes_.data());
    round_off::Sum constant;
    constant.value = signal.row.constant + held_part(state, signal);
    constant.size = std::abs(signal.row.constant) + held_size(state, signal);
    return first_sign(motion_.basis(), coefficients_.data(), sizes_.data(), constant, since);
}

// Sets the phases of a state that has been entered; `refused` flags elements whose requests were not granted.
void Law::update_phases(State& state, const Flags* refused) {
    const std::vector<Guard>& guards = state.level->guards();
    state.phases.resize(guards.size());
    state.all_armed = true;
    for (std::size_t k = 0; k < guards.size(); ++k) {
        const Guard& guard = guards[k];
        state.phases[k] = immovable_[guard.element] ? Phase::armed : phase_of(state, guard);
        if (state.phases[k] == Phase::armed) continue;
        state.all_armed = false;
        if (refused && (*refused)[guard.element]) state.phases[k] = Phase::refused;
    }
    hold_exchanging(state);
}

bool Law::is_denied(const State& state, int element) const {
    // Guards that are taken unconditionally follow at once, and deny nothing.
    for (int k = state.level->first_guard(element); k < state.level->end_guard(element); ++k)
        if (state.phases[k] == Phase::refused && !multiphi::is_unconditional(state.level->guards()[k].rule)) return true;
    return false;
}

bool Law::is_refused(const State& state, int element) {
    for (int k = state.level->first_guard(element); k < state.level->end_guard(element); ++k)
        if (state.phases[k] == Phase::refused) return true;
    return false;
}

bool Law::is_pulled(const State& state) {
    for (const Guard& guard : state.level->guards())
        if (guard.target == open_state && model_->elements[guard.element].is_rigid() &&
            phase_of(state, guard) == Phase::refused)
            return true;
    return false;
}

void Law::hold_back(State& state) {
    for (std::size_t k = 0; k < state.phases.size(); ++k) {
        const int element = state.level->guards()[k].element;
        if (instant.refused_before[element] && state.phases[k] == Phase::refused) {
            state.phases[k] = Phase::held_back;
            state.all_armed = false;
        }
    }
}

// Arms guards that are taken unconditionally, have a zero signal and lead back to the state before the instant: the
// signal by which the element came here was zero too, and what either signal says beyond that is round-off. This does not
// concern a rigid contact that is left without a reaction, which opens, nor an element that other elements changed.
void Law::arm_return_guards() {
    State& trial = instant.trial;
    for (std::size_t k = 0; k < trial.phases.size(); ++k) {
        const Guard& guard = trial.level->guards()[k];
        const bool leads_back = multiphi::is_unconditional(guard.rule) &&
                                guard.target == instant.reached.level->state(guard.element);
        const bool pulls = model_->elements[guard.element].is_rigid() && guard.target == open_state;
        if (leads_back && trial.phases[k] == Phase::refused && !pulls && instant.treated[guard.element] &&
            signal_sign(trial, guard.signal) == 0)
            trial.phases[k] = Phase::armed;
    }
}

// Holds open the rigid contacts of a state that exchange their states too fast.
void Law::hold_exchanging(State& state) {
    for (int i = 0; i < model_->size(); ++i)
        if (state.level->state(i) == open_state && exchanges_->is_held(i, instant.time)) {
            state.phases[state.level->first_guard(i)] = Phase::held_back;
            state.all_armed = false;
        }
}

// Counts the rigid contacts without restitution that have closed at the instant, each once. With all modes states exclude
// each other, and no contact may enter its stop.
void Law::count_closings() {
    if (model_->is_complete) return;
    const double fastest =
        std::max(instant.reached.level->highest_frequency(), instant.trial.level->highest_frequency());
    if (!(fastest > 0.0)) return;
    for (int i = 0; i < model_->size(); ++i) {
        if (!model_->elements[i].is_rigid() || model_->elements[i].restitution > 0.0) continue;
        const bool closes = std::any_of(
            instant.changes.begin() + instant.first_change, instant.changes.end(), [i](const Change& change) {
                return change.element == i && change.left == open_state && change.entered > open_state;
            });
        if (closes) exchanges_->count(i, instant.time, 1.0 / fastest);
    }
}

bool Law::release_held(double start) {
    State& reached = instant.reached;
    std::fill(instant.asked.begin(), instant.asked.end(), no_request);
    bool any = false;
    for (int i = 0; i < model_->size(); ++i) {
        if (reached.level->state(i) != open_state || !exchanges_->is_released(i, start, instant.time)) continue;
        const int k = reached.level->first_guard(i);
        const Guard& guard = reached.level->guards()[k];
        reached.phases[k] = phase_of(reached, guard);
        if (reached.phases[k] != Phase::refused) continue;
        instant.asked[i] = guard.target;
        any = true;
    }
    return any;
}

void Law::arm(State& reached, int guard) {
    reached.phases[guard] = Phase::armed;
    reached.all_armed = true;
    for (const Phase phase : reached.phases)
        if (phase != Phase::armed) reached.all_armed = false;
}

void Law::flag_repeated_requests(bool at_once) {
    if (!at_once) std::fill(instant.refused_before.begin(), instant.refused_before.end(), 0);
    for (std::size_t k = 0; k < (at_once ? instant.reached.phases.size() : 0); ++k) {
        const int element = instant.reached.level->guards()[k].element;
        if (instant.asked[element] != no_request && instant.reached.phases[k] == Phase::refused)
            instant.refused_before[element] = 1;
    }
}

}  // namespace multiphi
