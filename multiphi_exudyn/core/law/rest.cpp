// Rigid contacts at rest right after an impact: which of them stay closed (sentence 2).
//
// `struck_`               the state after the impact, in the level in which all touching contacts are open
// `at_rest_`, `entered_`  the same without negligible velocities, and in the level in which the contacts `closed_` are closed
#include <algorithm>
#include <cmath>

#include "failure.hpp"
#include "law/law.hpp"
#include "orthonormal.hpp"
#include "round_off.hpp"

namespace multiphi {

// Sets `closed_`: contacts at rest relative to their stop that the free motion would close; how many. The free motion is
// judged by its acceleration, and if that presses none of them by its first derivative that is not zero. A contact counts as
// at rest also if it would be back at its stop, with the contacts at rest held, before its gap is more than round-off.
int Law::find_pressed() {
    const std::size_t strict = list_resting(false);
    solve_resting_forces();
    if (list_resting(true) > strict) solve_resting_forces();
    std::fill(closed_.begin(), closed_.end(), 0);
    bool any_pressed = false;
    for (std::size_t k = 0; k < resting_.size(); ++k)
        if (impact_.problem.multipliers[k] > 0.0) closed_[resting_[k]] = any_pressed = true;
    if (!any_pressed)
        for (const int contact : resting_) {
            const Guard& guard = struck_.level->guards()[struck_.level->first_guard(contact)];
            if (phase_of(struck_, guard) == Phase::refused) closed_[contact] = any_pressed = true;
        }
    if (!any_pressed) return 0;
    held_.assign(model_->size(), 0);
    return keep_independent(closed_, held_);
}

// Lists touching contacts at rest relative to their stop after an impact in `resting_`, and returns their number. unseen:
// contacts too whose gap the accelerations close again before it is more than round-off.
std::size_t Law::list_resting(bool unseen) {
    const Level& level = *struck_.level;
    resting_.clear();
    for (std::size_t k = 0; k < touching_.size(); ++k) {
        const double* row = level.data().velocity_rows.row(touching_[k]).data();
        double velocity = 0.0;
        for (int i = 0; i < level.width(); ++i) velocity += row[i] * struck_.velocity[i];
        double size =
            impact::resting * (impact::velocity_size(released_, row) + impact::velocity_size(struck_, row));
        if (unseen && !has_rebounded(static_cast<int>(k)))
            size = std::max(size, impact::negligible_velocity(struck_, touching_[k], row, acceleration_));
        if (std::abs(velocity) <= size) resting_.push_back(touching_[k]);
    }
    return resting_.size();
}

// Solves for the forces and accelerations of the contacts `resting_`; `acceleration_` becomes xi'' with these forces.
void Law::solve_resting_forces() {
    const Level& level = *struck_.level;
    accelerate(struck_, *inputs_, acceleration_);
    if (resting_.empty()) return;
    acceleration_sizes(struck_, *inputs_, acceleration_sizes_);
    acceleration_sizes(released_, *inputs_, released_sizes_);
    impact_.fill_rows(level, resting_);
    const int rest = static_cast<int>(resting_.size());
    const int rows = impact_.add_friction_rows(struck_, resting_, &released_);
    resting_sizes_.resize(rows);
    for (int k = 0; k < rows; ++k)
        resting_sizes_[k] = impact::resting_size(acceleration_sizes_, released_sizes_, impact_.row(k));
    try {
        impact_.least_change(level, resting_, acceleration_, &resting_sizes_, nullptr, nullptr);
    } catch (const NumericalFailure&) {
        refuse_sliding_level();  // by what makes the motion of its level indeterminate, if that is so
        throw;
    }
    const SmallProblem& problem = impact_.problem;
    for (int k = rest; k < rows; ++k) {
        const int leader = problem.leaders[k];
        const bool slips = problem.sides[k] == SmallProblem::Side::below || problem.sides[k] == SmallProblem::Side::above;
        if (problem.multipliers[leader] > 0.0 && slips)
            impact_.enters[resting_[leader]] =
                closed_state + (problem.sides[k] == SmallProblem::Side::below ? slip_forward : slip_backward);
    }
    for (int i = 0; i < level.modes(); ++i) acceleration_[i] += problem.change[i];
}

// Builds the level with the sliding contacts, whose forces are indeterminate: if its motion is indeterminate too, it is
// refused when it is built, with a better reason (10).
void Law::refuse_sliding_level() {
    key_ = open_key_;
    for (const int contact : resting_)
        if (impact_.enters[contact] > closed_state) key_[contact] = impact_.enters[contact];
    levels_->level(key_);
}

// Removes from `closed_` the contacts that would pull in its level; how many. `entered_` becomes the state in that level: its
// displacement comes from the level before the impact, its velocity from `at_rest_`.
int Law::drop_pulled(bool is_same) {
    remove_negligible_velocities();
    key_ = open_key_;
    for (int i = 0; i < model_->size(); ++i)
        if (closed_[i]) key_[i] = impact_.enters[i];
    const Level& level = levels_->level(key_);
    const State& trial = instant.trial;
    mover_.move(trial, levels_->transition(*trial.level, level), at_rest_,
                levels_->transition(*at_rest_.level, level), *inputs_, entered_);
    std::vector<int> pulled;
    for (int i = 0; i < model_->size(); ++i) {
        if (!closed_[i]) continue;
        const int sign = reaction_sign(trial, at_rest_, level, i);
        const bool is_freed = instant.freed[i];
        if (sign < (is_freed ? 1 : 0) || (is_freed && is_same && &level == trial.level)) pulled.push_back(i);
    }
    for (const int contact : pulled) closed_[contact] = 0;
    return static_cast<int>(pulled.size());
}

// Sets `at_rest_`: after an impact, contacts that stay closed lose negligible velocities, and give them to no other contact.
// `further_impulses_`: those on the touching contacts.
void Law::remove_negligible_velocities() {
    const Level& level = *struck_.level;
    std::vector<int> contacts = touching_;
    for (int i = 0; i < model_->size(); ++i)
        if (closed_[i]) contacts.push_back(i);
    const int count = static_cast<int>(touching_.size()), held = static_cast<int>(contacts.size()) - count;
    at_rest_loss_ = Loss();
    bool any_moves = false;
    for (int k = count; k < count + held; ++k) {
        const double* row = level.data().velocity_rows.row(contacts[k]).data();
        double velocity = 0.0;
        for (int i = 0; i < level.width(); ++i) velocity += row[i] * struck_.velocity[i];
        if (!(std::abs(velocity) <= impact::resting * impact::velocity_size(struck_, row))) any_moves = true;
    }
    if (!any_moves) {
        further_impulses_.assign(count, 0.0);
        at_rest_ = struck_;
        return;
    }
    impact_.collide(struck_, contacts, held, nullptr, nullptr, *inputs_, at_rest_, further_impulses_, at_rest_loss_);
    for (int h = count; h < count + held; ++h)
        for (int k = 0; k < count; ++k)
            if (contacts[k] == contacts[h]) further_impulses_[k] -= further_impulses_[h];
}

// The sign of a contact's reaction in a level, 0 if it is round-off of the mapped terms; xi is that of one state, xi' of
// another. This is the same function as the signal in the level that a refused contact would enter alone: so the contact
// requests its change at the root of the function that decides on it.
int Law::reaction_sign(const State& displaced, const State& moving, const Level& level, int contact) {
    const Row& row = level.opening(contact).signal.row;
    const Transition &by_displacement = levels_->transition(*displaced.level, level),
                     &by_velocity = levels_->transition(*moving.level, level);
    const int n = level.width();
    round_off::Sum sum;
    sum.add(row.constant);
    for (int i = 0; i < n; ++i) sum.add(row.displacement[i] * by_displacement.offset[i]);
    for (int j = 0; j < displaced.level->width(); ++j) {
        round_off::Sum factor;
        for (int i = 0; i < n; ++i) factor.add(row.displacement[i] * by_displacement.matrix(i, j));
        sum.value += factor.value * displaced.displacement[j];
        sum.add_size(factor.size * std::abs(displaced.displacement[j]));
    }
    for (int j = 0; j < moving.level->width(); ++j) {
        round_off::Sum factor;
        double reached = 0.0;
        for (int i = 0; i < n; ++i) {
            factor.add(row.velocity[i] * by_velocity.velocity_matrix(i, j));
            reached += std::abs(row.displacement[i] * by_velocity.matrix(i, j));
        }
        sum.value += factor.value * moving.velocity[j];
        sum.add_size(factor.size * std::abs(moving.velocity[j]) + reached * moving.displacement_scale[j]);
    }
    return sum.sign();
}

}  // namespace multiphi
