// The decision of an instant: which elements change their states, and which level follows.
//
// `decide` computes the state after an instant, `settle` repeats decisions until no refused element is untreated, and
// `apply_requests` passes requests to striking, sticking or switching. An exchange of states without end is a failure.
#include <algorithm>

#include "failure.hpp"
#include "law/law.hpp"

namespace multiphi {

namespace {

constexpr int most_returns = 3;  // changes of an element from or to a state at an instant; after more it keeps its state
constexpr int rounds = 20;       // decisions at one instant: with more the contacts exclude each other's states without end

}  // namespace

Law::Law(Levels& levels, const Inputs& inputs, Exchanges& exchanges)
    : levels_(&levels), model_(&levels.model()), inputs_(&inputs), exchanges_(&exchanges), impact_(levels.model()) {
    const int count = model_->size();
    for (Requests* requests : {&instant.asked, &targets_, &pending_, &pulling_}) requests->assign(count, no_request);
    for (Flags* flags : {&instant.refused_before, &instant.treated, &instant.freed, &instant.begins_last_bounce,
                         &immovable_, &striking_, &denied_, &closed_})
        flags->assign(count, 0);
    open_key_.assign(count, open_state);
}

void Law::decide() {
    instant.loss = Loss();
    instant.changes.resize(instant.first_change);
    instant.transitions = 0;
    instant.velocities_changed = instant.is_mapped_again = instant.decided_together = false;
    instant.trial = instant.reached;
    std::fill(instant.begins_last_bounce.begin(), instant.begins_last_bounce.end(), 0);
    clear_turning_velocities(instant.trial);
    settle();
    const bool any = static_cast<int>(instant.changes.size()) > instant.first_change;
    bool is_changed = instant.loss.friction != 0.0 || instant.reached.level != instant.trial.level;
    for (std::size_t k = instant.first_change; k < instant.changes.size(); ++k)
        if (instant.changes[k].is_shared() || instant.changes[k].impulse != 0.0) is_changed = true;
    if (any && !is_changed && !is_pulled(instant.reached)) {  // every element is in its old state: nothing has changed
        instant.trial = instant.reached;
        for (int i = 0; i < model_->size(); ++i) denied_[i] = instant.asked[i] != no_request;
        update_phases(instant.trial, &denied_);
        hold_back(instant.trial);
        instant.loss = Loss();
        instant.changes.resize(instant.first_change);
    }
    // What has changed may admit what was refused before.
    if (static_cast<int>(instant.changes.size()) > instant.first_change)
        std::fill(instant.refused_before.begin(), instant.refused_before.end(), 0);
    mark_last_bounces();
    count_closings();
    hold_exchanging(instant.trial);
}

bool Law::decide_jump() {
    std::fill(instant.asked.begin(), instant.asked.end(), no_request);
    std::fill(instant.refused_before.begin(), instant.refused_before.end(), 0);
    instant.changes.clear();
    bool any = false;
    const State& reached = instant.reached;
    for (std::size_t k = 0; k < reached.phases.size(); ++k) {
        const Guard& guard = reached.level->guards()[k];
        const bool is_armed = reached.phases[k] == Phase::armed || reached.phases[k] == Phase::landing;
        if (is_armed && signal_sign(reached, guard.signal) < 0) {
            instant.asked[guard.element] = guard.target;
            any = true;
        }
    }
    if (any) decide();
    return any;
}

void Law::settle() {
    const int count = model_->size();
    bool any = false;
    for (int i = 0; i < count; ++i) {
        instant.treated[i] = instant.asked[i] != no_request;
        instant.freed[i] = instant.asked[i] == open_state && instant.trial.level->is_closed_rigid(i);
        any = any || instant.treated[i];
    }
    if (any)
        apply_requests(instant.asked);
    else
        update_phases(instant.trial, nullptr);
    const std::size_t most_changes = rounds * (3 * count + 1) + model_->knots;
    for (int round = 0; round < rounds + count + model_->knots; ++round) {
        arm_return_guards();
        const Refusals refusals = classify_refusals();
        if (refusals == Refusals::none) return;
        if (instant.changes.size() + 3 * count > most_changes) break;
        switch (refusals) {
            case Refusals::none:
                return;
            case Refusals::untreated:
                for (int i = 0; i < count; ++i) {
                    if (pending_[i] == no_request) continue;
                    instant.treated[i] = 1;
                    if (pending_[i] == open_state && instant.trial.level->is_closed_rigid(i)) instant.freed[i] = 1;
                }
                apply_requests(pending_);
                break;
            case Refusals::always_taken: {  // treated before: changes of others at this instant have removed its reaction
                const std::size_t changes = instant.changes.size();
                switch_states(pulling_);
                if (instant.changes.size() == changes) {
                    hold_back(instant.trial);
                    return;
                }
                break;
            }
            case Refusals::others:
                hold_back(instant.trial);
                return;
        }
    }
    std::vector<int> elements;
    for (int i = 0; i < count; ++i)
        if (pending_[i] != no_request) elements.push_back(i);
    throw NumericalFailure(Cause::not_admissible, elements);
}

// What kind of refused guards the trial state has: of elements not treated yet at this instant (requests in `pending_`);
// such that are taken unconditionally (requests in `pulling_`); or others only. An element that has changed counts as
// treated. A guard that is taken once, and that of a viscous contact that would pull, is taken if another element has
// changed since; the first one does not wait if an impact at this instant has reversed it.
Law::Refusals Law::classify_refusals() {
    const State& trial = instant.trial;
    for (std::size_t k = instant.first_change; k < instant.changes.size(); ++k)
        if (!instant.changes[k].is_shared()) instant.treated[instant.changes[k].element] = 1;
    std::fill(pending_.begin(), pending_.end(), no_request);
    std::fill(pulling_.begin(), pulling_.end(), no_request);
    bool any = false, any_untreated = false, any_taken = false;
    for (int k = 0; k < static_cast<int>(trial.phases.size()); ++k) {
        const Guard& guard = trial.level->guards()[k];
        if (trial.phases[k] != Phase::refused && !is_reversed_by_impact(k)) continue;
        any = true;
        if (!instant.treated[guard.element]) {
            pending_[guard.element] = guard.target;
            any_untreated = true;
        }
        const bool is_viscous =
            guard.target == open_state && model_->elements[guard.element].kind == Kind::viscous;
        const bool is_once = (is_viscous || guard.rule == Rule::taken_once) && !is_return(guard.element, guard.target);
        if (guard.rule == Rule::always_taken || guard.rule == Rule::taken_falling || is_once) {
            pulling_[guard.element] = guard.target;
            any_taken = true;
        }
    }
    if (!any) return Refusals::none;
    if (any_untreated) return Refusals::untreated;
    return any_taken ? Refusals::always_taken : Refusals::others;
}

// Whether a guard taken once is recovering in the trial state, but was not before an impact at this instant: it was armed
// before the instant in the same state, or leads back to that state, which was left before the impact.
bool Law::is_reversed_by_impact(int guard) const {
    const State &trial = instant.trial, &reached = instant.reached;
    const Guard& waiting = trial.level->guards()[guard];
    const int element = waiting.element;
    if (trial.phases[guard] != Phase::recovering || waiting.rule != Rule::taken_once ||
        is_return(element, waiting.target))
        return false;
    if (reached.level->state(element) != trial.level->state(element))
        return instant.velocities_changed && reached.level->state(element) == waiting.target;
    const int before = reached.level->first_guard(element) + guard - trial.level->first_guard(element);
    return reached.phases[before] == Phase::armed;
}

// Whether an element was the last to change, out of the requested state, or has changed too often (8).
bool Law::is_return(int element, int requested) const {
    int last = no_request, left = no_request, count = 0;
    for (std::size_t k = instant.first_change; k < instant.changes.size(); ++k) {
        const Change& change = instant.changes[k];
        last = change.element;
        left = change.left;
        if (last == element && (left == requested || change.entered == requested)) ++count;
    }
    return (last == element && left == requested) || count > most_returns;
}

// Decides requests: `instant.trial` becomes the state, with its phases, after them. `treated` flags all contacts that touch
// at this instant, too, and `freed` those of them whose reaction has fallen to zero at it. What a viscous contact requests
// is left for the next decision if there is an impact.
void Law::apply_requests(Requests& requests) {
    const int count = model_->size();
    set_requested_states(requests);
    const std::size_t before = instant.changes.size();
    instant.transition_loss = Loss();
    flag_touching(requests);
    bool any_strikes = false;
    for (int i = 0; i < count; ++i) {
        const Element& element = model_->elements[i];
        const int state = instant.trial.level->state(i), stick = element.stick.state;
        striking_[i] = element.is_rigid() && state == open_state && !exchanges_->is_held(i, instant.time) &&
                       (instant.treated[i] || is_inside(instant.trial, i));
        any_strikes = any_strikes || (striking_[i] && requests[i] != no_request);
        int requested = requests[i] == no_request ? state : requests[i];
        if (element.stick.spring > 0.0 && state == stick && requested > stick)
            requested = stick;  // its velocity after the impact decides whether it slips
        open_key_[i] = element.is_rigid() ? open_state : requested;
        if (follows_impact(requests, i)) open_key_[i] = state;
        if (bears_no_impulse(i) && open_key_[i] >= stick) {  // slips, in either direction
            const bool begins = state == stick && requested > stick;
            open_key_[i] = begins ? requested : std::max(state, stick + slip_forward);
        }
    }
    if (!any_strikes) {
        stick_together(requests);
        if (std::any_of(requests.begin(), requests.end(), [](int request) { return request != no_request; }))
            switch_states(requests);
        return;
    }
    for (int i = 0; i < count; ++i)
        if (follows_impact(requests, i)) instant.treated[i] = 0;
    strike();
    const bool is_in_vain = entered_.level == instant.trial.level && come_inside(requests);
    if (instant.changes.size() == before || is_in_vain) {
        instant.changes.resize(before);
        instant.transition_loss = Loss();
        close_without_impact(requests);
        return;
    }
    enter(entered_);
}

bool Law::follows_impact(const Requests& requests, int element) const {
    if (requests[element] == no_request || model_->elements[element].kind != Kind::viscous) return false;
    return instant.trial.level->state(element) == open_state || requests[element] == open_state;
}

// ---------------------------------------------------------------------- parts

void Law::transfer(const State& state, const Key& key, State& result) {
    const Level& level = levels_->level(key);
    instant.transition_loss = Loss();
    if (&level == state.level) {
        result = state;
        return;
    }
    const Transition& transition = levels_->transition(*state.level, level);
    mover_.move(state, transition, state, transition, *inputs_, result);
    add_losses(state, state.level->key(), result, 0.0, instant.transition_loss);
}

void Law::enter(const State& state) {
    instant.trial = state;
    update_phases(instant.trial, nullptr);
    ++instant.transitions;
    if (instant.transitions > 1) instant.is_mapped_again = true;
    instant.loss += instant.transition_loss;
}

void Law::record_change(int element, int entered, double impulse) {
    instant.changes.push_back({element, entered, instant.trial.level->state(element), impulse});
}

}  // namespace multiphi
