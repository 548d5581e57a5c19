// Rigid friction elements at rest are decided together (sentence 12).
//
//     h.x'' = A eta'' = A eta''_0 + A A^T z,   -limit <= f <= limit complementary to h.x'',   f = f_0 + z
//
// f is the force along +h, f_0 that of slip, and eta''_0 the acceleration in the level in which all of these elements slip:
// those that stick, or reverse their slip, have no velocity relative to their counter-surface. f = -limit means slip forward,
// f = limit backward, and a force between them stick.
//
// At a contact that is not rigid the limit is mu N, a number at an instant, as N depends on displacements and velocities only.
// In that level such friction does not slip but is idle, f_0 = 0, and stays idle if other elements stick for it: of two with
// one normal force, the force of one would otherwise be the limit of the other.
#include <algorithm>
#include <cmath>
#include <limits>

#include "failure.hpp"
#include "law/law.hpp"
#include "orthonormal.hpp"
#include "round_off.hpp"

namespace multiphi {

// Done once at an instant, and only if several elements are at rest. If any of them changes, their requests are removed. A
// closed rigid contact that would pull beside them opens, and the decision is repeated without it. The same holds for a contact
// that would pull if elements stuck which now fall from their static limits, if all of these stick without it.
void Law::stick_together(Requests& requests) {
    const bool any_requests = list_at_rest(requests);
    if (!any_requests || resting_.size() < 2 || instant.decided_together) return;
    instant.decided_together = true;
    const Key& states = instant.trial.level->key();
    targets_ = states;
    do {
        if (decide_at_rest(requests) > 0) retry_without_pulled(requests);
    } while (open_pulled());
    bool any_changes = false;
    for (int i = 0; i < model_->size(); ++i) {
        if (targets_[i] == states[i])
            targets_[i] = no_request;
        else
            any_changes = true;
    }
    if (!any_changes) return;
    for (int i = 0; i < model_->size(); ++i)
        if (targets_[i] == open_state && model_->elements[i].is_rigid()) requests[i] = no_request;
    for (const int i : resting_) requests[i] = no_request;
    zero_resting_velocities();
    open_and_enter();
}

// Decides the elements at rest beside the states `targets_`, which become theirs, with `candidate_` the state in that level. How
// many fall from their static limits to slip.
int Law::decide_at_rest(const Requests& requests) {
    key_ = targets_;
    for (const int i : resting_) key_[i] = state_without_stick(i, instant.trial.level->state(i));
    const Key slipping = key_;
    transfer(instant.trial, key_, candidate_);
    sort_by_reserve();
    pose_friction_problem(requests);
    int falling = 1, fallen = 0;
    while (falling > 0) {
        if (impact_.problem.solve(SmallProblem::Order::in_turn) != SmallProblem::Outcome::solved)
            throw NumericalFailure(Cause::unsettled);
        impact_.problem.free_balanced_rows();
        falling = choose_states(requests);
        fallen += falling;
    }
    stick_independent_set(slipping);
    transfer(instant.trial, targets_, candidate_);
    return fallen;
}

// Tries without the closed contacts that would pull if the fallen elements stuck. If no element falls without these contacts,
// `targets_` and `candidate_` become that decision; else they are restored.
void Law::retry_without_pulled(const Requests& requests) {
    bool any_closed = false;
    for (int i = 0; i < model_->size(); ++i) any_closed = any_closed || candidate_.level->is_closed_rigid(i);
    if (!any_closed) return;
    const Requests decided = targets_;
    for (const int i : resting_)
        if (model_->elements[i].static_limit > model_->elements[i].limit) targets_[i] = model_->elements[i].stick.state;
    union_.resize(model_->size());
    for (int i = 0; i < model_->size(); ++i) union_[i] = held_links(i, targets_[i]);
    if (are_independent(union_)) {
        transfer(instant.trial, targets_, candidate_);
        if (open_pulled() && decide_at_rest(requests) == 0) return;
    }
    targets_ = decided;
    transfer(instant.trial, targets_, candidate_);
}

// Sets the targets of rigid contacts that `candidate_` pulls to open; whether there are any (3, 12).
bool Law::open_pulled() {
    const Level& level = *candidate_.level;
    bool any = false;
    for (int i = 0; i < model_->size(); ++i) {
        if (!level.is_closed_rigid(i) || signal_sign(candidate_, level.opening(i).signal) >= 0) continue;
        targets_[i] = open_state;
        any = true;
    }
    return any;
}

// Removes the slip velocities of elements at rest from `candidate_`: they are round-off, and would turn the direction of slip.
// Elements that stick have none.
void Law::zero_resting_velocities() {
    const Level& level = *candidate_.level;
    std::vector<int> slipping;
    for (const int i : resting_)
        if (level.state(i) != model_->elements[i].stick.state) slipping.push_back(i);
    if (slipping.empty()) return;
    fill_friction_rows(level, slipping);
    SmallProblem& problem = impact_.problem;
    Vector& velocity = candidate_.velocity;
    const int n = level.width();
    for (int k = 0; k < problem.count(); ++k) {
        const double* row = problem.rows[k];
        double terms = 0.0;
        for (int j = 0; j < n; ++j) terms += std::abs(row[j]) * (std::abs(velocity[j]) + candidate_.velocity_scale[j]);
        problem.values[k] = scalar_product(row, velocity.data(), n);
        problem.sizes[k] = terms;
        problem.lower[k] = -std::numeric_limits<double>::infinity();
        problem.upper[k] = std::numeric_limits<double>::infinity();
    }
    if (problem.solve(SmallProblem::Order::most_violated) != SmallProblem::Outcome::solved)
        throw NumericalFailure(Cause::unsettled);
    instant.velocities_changed = true;
    for (int i = 0; i < level.modes(); ++i) {
        const double before = std::abs(velocity[i]);
        velocity[i] += problem.change[i];
        if (std::abs(velocity[i]) <= impact::resting * before) velocity[i] = 0.0;
    }
}

// Sets `targets_` to the states of the solution; how many elements fall from their static limit. Elements that come from slip
// fall first: the others may then need no more than their static limit, and go on sticking. An element that requests slip at
// its static limit, with a force that would exceed it, falls unless others now bear more. An element whose bound is its limit
// slips there, also if its force is within round-off of the limit. One that needs just a larger static limit, to round-off,
// sticks: that limit still holds it, and if not for long, it falls by itself.
int Law::choose_states(const Requests& requests) {
    const Level& level = *instant.trial.level;
    SmallProblem& problem = impact_.problem;
    int falling = 0;
    for (const bool stuck : {false, true}) {
        for (int k = 0; k < static_cast<int>(resting_.size()); ++k) {
            const int i = resting_[k];
            const Element& element = model_->elements[i];
            const int stick = element.stick.state;
            const double normal = normal_force(i), limit = normal * element.limit, most = normal * element.static_limit;
            const double of_slip = slip_force(i, limit), force = problem.multipliers[k] - of_slip;
            const SmallProblem::Side side = problem.sides[k];
            const bool is_at_bound = side == SmallProblem::Side::below || side == SmallProblem::Side::above;
            const bool is_reached = std::abs(force) >= (1.0 - round_off::following) * most;
            int entered = stick;
            if (problem.lower[k] == problem.upper[k]) {
                entered += problem.lower[k] - of_slip < 0.0 ? slip_forward : slip_backward;
            } else if (is_at_bound || (is_reached && (most <= limit || is_at_limit(i, requests[i])))) {
                entered += side == SmallProblem::Side::above || force > 0.0 ? slip_backward : slip_forward;
                const bool falls_first = (level.state(i) == stick) == stuck;
                if (falls_first && most > limit && std::abs(force) > limit) {
                    const double bound = entered == stick + slip_forward ? of_slip - limit : of_slip + limit;
                    problem.lower[k] = problem.upper[k] = bound;
                    ++falling;
                }
            }
            targets_[i] = entered;
        }
        if (falling > 0) break;
    }
    return falling;
}

// Lets elements at rest without an added force stick, as long as the sticking directions are independent. They have a larger
// static limit, or are idle. An element that bears just its limit, to round-off, and can bear no more keeps slipping, as in the
// key `slipping`: it would stick only to slip at the same instant.
void Law::stick_independent_set(const Key& slipping) {
    const std::vector<SmallProblem::Side>& sides = impact_.problem.sides;
    union_.resize(model_->size());
    for (int i = 0; i < model_->size(); ++i) union_[i] = held_links(i, targets_[i]);
    for (std::size_t k = 0; k < resting_.size(); ++k)
        if (sides[k] == SmallProblem::Side::waiting) union_[resting_[k]] = 0;
    for (std::size_t k = 0; k < resting_.size(); ++k) {
        const int i = resting_[k];
        if (sides[k] != SmallProblem::Side::waiting) continue;
        union_[i] = 2;
        if (are_independent(union_)) {
            targets_[i] = model_->elements[i].stick.state;
        } else {
            union_[i] = 0;
            targets_[i] = slipping[i];
        }
    }
}

}  // namespace multiphi
