// Friction elements at rest, and the complementarity problem of their accelerations and forces (sentence 12).
#include <cmath>

#include "law/law.hpp"
#include "orthonormal.hpp"
#include "round_off.hpp"

namespace multiphi {

// Lists in `resting_` the rigid friction elements that stick, request a change or have no slip velocity; false if none of them
// requests a change.
bool Law::list_at_rest(const Requests& requests) {
    const Level& level = *instant.trial.level;
    resting_.clear();
    bool any_requests = false;
    for (int i = 0; i < model_->size(); ++i) {
        if (!(model_->elements[i].limit > 0.0 && normal_force(i) > 0.0)) continue;
        const int stick = model_->elements[i].stick.state;
        const bool asks = requests[i] >= stick;  // to stick or slip: a contact that opens is not at rest
        const bool rests = level.state(i) == stick || asks;
        if (!rests && signal_sign(instant.trial, level.guards()[level.first_guard(i)].signal) != 0) continue;
        resting_.push_back(i);
        if (requests[i] != no_request) any_requests = true;
    }
    return any_requests;
}

// Sorts the elements at rest by the reserve of their static limit over their limit, the smallest first: of redundant elements
// the one with the largest reserve then reaches its limit last; the others exert their limit. Reserves that are equal but for
// round-off keep their order.
void Law::sort_by_reserve() {
    const Level& level = *candidate_.level;
    std::vector<double> reserves;
    std::vector<int> sorted;
    for (const int i : resting_) {
        const Element& element = model_->elements[i];
        const double reserve = element.static_limit - element.limit;
        const double* row = level.data().velocity_rows.row(element.stick.link).data();
        const double size = reserve > 0.0 ? reserve * normal_force(i) * norm(row, level.modes()) : 0.0;
        std::size_t place = sorted.size();
        while (place > 0 && (1.0 - round_off::alike) * reserves[place - 1] > size) --place;
        reserves.insert(reserves.begin() + place, size);
        sorted.insert(sorted.begin() + place, i);
    }
    resting_ = sorted;
}

// Poses the problem of the elements at rest in `candidate_`, in which they slip: their accelerations, and the bounds of the
// added forces.
void Law::pose_friction_problem(const Requests& requests) {
    const Level& level = *candidate_.level;
    accelerate(candidate_, *inputs_, acceleration_);
    acceleration_sizes(candidate_, *inputs_, acceleration_sizes_);
    fill_friction_rows(level, resting_);
    SmallProblem& problem = impact_.problem;
    for (int k = 0; k < static_cast<int>(resting_.size()); ++k) {
        const int i = resting_[k];
        const Element& element = model_->elements[i];
        const double normal = normal_force(i), limit = normal * element.limit;
        const double static_limit = normal * element.static_limit, of_slip = slip_force(i, limit);
        problem.lower[k] = of_slip - static_limit;
        problem.upper[k] = of_slip + static_limit;
        if (static_limit <= limit && is_at_limit(i, requests[i])) {  // the force would exceed it
            const bool is_forward = requests[i] == element.stick.state + slip_forward;
            problem.lower[k] = problem.upper[k] = is_forward ? of_slip - limit : of_slip + limit;
        }
        problem.values[k] = scalar_product(problem.rows[k], acceleration_.data(), level.width());
        problem.sizes[k] = impact::resting_size(acceleration_sizes_, acceleration_sizes_, problem.rows[k]);
    }
}

// Poses a problem with the slip velocities of friction elements as rows.
void Law::fill_friction_rows(const Level& level, const std::vector<int>& elements) {
    std::vector<int> links;
    for (const int i : elements) links.push_back(model_->elements[i].stick.link);
    impact_.fill_rows(level, links);
}

// The friction force along -h of an element that slips in the level of `candidate_`, zero if idle.
double Law::slip_force(int element, double limit) const {
    const int way = candidate_.level->state(element) - model_->elements[element].stick.state;
    if (way == idle) return 0.0;
    return way == slip_forward ? limit : -limit;
}

// The factor of an element's friction limits in the trial state: the normal force N, zero if it is round-off, or 1 for friction
// that is no part of a contact, whose limits are forces.
double Law::normal_force(int element) const {
    const State& trial = instant.trial;
    const Element& of = model_->elements[element];
    if (of.kind == Kind::sliding) return 1.0;
    if (trial.level->state(element) == open_state) return 0.0;
    const Signal& signal = trial.level->opening(element).signal;
    if (signal_sign(trial, signal) <= 0) return 0.0;
    const int n = trial.level->width();
    const double value = scalar_product(signal.row.displacement.data(), trial.displacement.data(), n) +
                         scalar_product(signal.row.velocity.data(), trial.velocity.data(), n) + signal.row.constant;
    return of.kind == Kind::compliant ? value * of.stiffness : value;
}

// Whether an element that sticks requests to slip with a force at its limit, and not beyond it.
bool Law::is_at_limit(int element, int requested) const {
    const State& trial = instant.trial;
    const int stick = model_->elements[element].stick.state;
    const int way = requested - stick;  // it may request to open, or to be idle, as well
    if (trial.level->state(element) != stick || (way != slip_forward && way != slip_backward)) return false;
    const int guard = trial.level->first_guard(element) + way - slip_forward;
    return signal_sign(trial, trial.level->guards()[guard].signal) == 0;
}

}  // namespace multiphi
