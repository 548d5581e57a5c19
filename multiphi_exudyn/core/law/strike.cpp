// Rigid contacts that close, with or without an impact (sentence 2).
#include <algorithm>
#include <cmath>

#include "law/law.hpp"
#include "orthonormal.hpp"

namespace multiphi {

// An impact of the contacts `striking_`, and of the closed ones: the velocities after it, the contacts that stay closed, and
// `entered_`, the state in their level. `open_key_` is the level in which all touching contacts are open. A contact of
// `freed`, whose reaction has just fallen to zero, stays closed only with a reaction clearly above zero, and not in the level
// and at the speed at which it fell to zero. Changes and losses are those of the whole impact.
void Law::strike() {
    touching_.clear();
    for (const int contact : model_->roughest_first)
        if (striking_[contact] || instant.trial.level->is_closed_rigid(contact)) touching_.push_back(contact);
    transfer(instant.trial, open_key_, released_);
    instant.velocities_changed = true;
    impact_loss_ = Loss();
    const bool rebounds = set_rebound_velocities(released_);
    collide_and_rebound(released_, rebounds, struck_, impact_loss_);
    if (rebounds) repeat_impacts(struck_, impact_loss_);
    const bool is_same = impact::same_velocity(released_, struck_);
    if (is_same) std::fill(impulses_.begin(), impulses_.end(), 0.0);  // round-off: no contact was struck
    int closed = find_pressed();
    if (rebounds && begin_last_bounces() > 0) closed = find_pressed();
    entered_ = struck_;
    while (closed > 0) {
        const int pulled = drop_pulled(is_same);
        if (pulled == 0) {
            instant.transition_loss = Loss();
            const double collided = kinetic_energy(released_) - kinetic_energy(at_rest_);
            add_losses(instant.trial, instant.trial.level->key(), entered_, collided, instant.transition_loss);
            instant.transition_loss += at_rest_loss_;
            for (std::size_t k = 0; k < touching_.size(); ++k) impulses_[k] += further_impulses_[k];
            break;
        }
        closed -= pulled;
        entered_ = struck_;
    }
    instant.transition_loss += impact_loss_;
    slip_after_impact();
    record_impact_changes();
}

// Lets rigid friction that bears no impulse slip in `entered_` with its velocity, or stay. Friction that would stick, but is
// redundant beside the links that hold, goes on slipping: the closed contact bears its force (12).
void Law::slip_after_impact() {
    const Level& level = *entered_.level;
    key_ = level.key();
    bool any_turns = false;
    for (int i = 0; i < model_->size(); ++i) {
        const Stick& friction = model_->elements[i].stick;
        if (!bears_no_impulse(i) || key_[i] < friction.state) continue;
        const double* row = level.data().velocity_rows.row(friction.link).data();
        const double velocity = scalar_product(row, entered_.velocity.data(), level.width());
        const bool rests = std::abs(velocity) <= impact::resting * impact::velocity_size(entered_, row);
        if (rests)
            key_[i] = std::max(instant.trial.level->state(i), friction.state);
        else
            key_[i] = friction.state + (velocity > 0.0 ? slip_forward : slip_backward);
        if (rests && is_redundant_stick(key_, i)) key_[i] = level.state(i);
        if (key_[i] != level.state(i)) any_turns = true;
    }
    if (!any_turns) return;
    const Level& slipping = levels_->level(key_);
    const Transition& transition = levels_->transition(level, slipping);
    mover_.move(entered_, transition, entered_, transition, *inputs_, candidate_);
    instant.is_mapped_again = true;
    add_losses(entered_, level.key(), candidate_, 0.0, instant.transition_loss);
    entered_ = candidate_;
}

// Whether truncation has left an open contact inside its stop in a state: it recovers, or is refused.
bool Law::is_inside(const State& state, int contact) {
    if (!state.level || state.level->state(contact) != open_state) return false;
    const Phase phase = state.phases[state.level->first_guard(contact)];
    return phase != Phase::armed && phase != Phase::landing;
}

// Whether all rigid contacts that request to close come to the instant inside their stops, none of them with restitution.
bool Law::come_inside(const Requests& requests) const {
    for (int i = 0; i < model_->size(); ++i)
        if (striking_[i] && requests[i] != no_request &&
            (!is_inside(instant.reached, i) || model_->elements[i].restitution > 0.0))
            return false;
    return true;
}

// Closes rigid contacts without an impact if the level entered gives them a reaction, else refuses them.
void Law::close_without_impact(const Requests& requests) {
    const Level& level = *instant.trial.level;
    held_.resize(model_->size());
    for (int i = 0; i < model_->size(); ++i) {
        held_[i] = held_links(i, level.state(i));
        closed_[i] = denied_[i] = striking_[i] && requests[i] != no_request;
    }
    keep_independent(closed_, held_);
    bool any_closes = false;
    for (int i = 0; i < model_->size(); ++i) {
        if (!closed_[i]) continue;
        key_ = level.key();
        key_[i] = requests[i];
        closed_[i] = reaction_sign(instant.trial, instant.trial, levels_->level(key_), i) >= 0;
        any_closes = any_closes || closed_[i];
    }
    if (!any_closes) {
        update_phases(instant.trial, &denied_);
        return;
    }
    key_ = level.key();
    for (int i = 0; i < model_->size(); ++i)
        if (closed_[i]) key_[i] = requests[i];
    transfer(instant.trial, key_, candidate_);
    for (int i = 0; i < model_->size(); ++i)
        if (closed_[i]) record_change(i, requests[i], 0.0);
    enter(candidate_);
}

// Lists all changes of an impact. A contact that strikes and does not stay closed has closed and opened at one instant.
void Law::record_impact_changes() {
    const std::size_t first = instant.changes.size();
    const Level &before = *instant.trial.level, &after = *entered_.level;
    std::vector<double> pushed(model_->size(), 0.0);
    for (std::size_t k = 0; k < touching_.size(); ++k) pushed[touching_[k]] = impulses_[k];
    for (int i = 0; i < model_->size(); ++i)
        if (before.state(i) == after.state(i) && before.state(i) != open_state && pushed[i] > 0.0)
            record_change(i, Change::shared, pushed[i]);
    const std::size_t unchanged = instant.changes.size();
    for (int i = 0; i < model_->size(); ++i)
        if (striking_[i] && (after.state(i) != open_state || pushed[i] > 0.0))
            record_change(i, std::max(after.state(i), closed_state), pushed[i]);
    for (int i = 0; i < model_->size(); ++i)
        if (!striking_[i] && after.state(i) != before.state(i) && after.state(i) != open_state)
            record_change(i, after.state(i), pushed[i]);
    for (int i = 0; i < model_->size(); ++i) {
        if (striking_[i] && after.state(i) == open_state && pushed[i] > 0.0) record_change(i, open_state, 0.0);
        if (before.state(i) != open_state && after.state(i) == open_state) record_change(i, open_state, pushed[i]);
    }
    if (instant.changes.size() == unchanged) instant.changes.resize(first);
}

}  // namespace multiphi
