// The start of a run: from displacement and velocity in all modes of the base to the first state of a level.
//
// In the key of the base the contacts that touch their stop at the start, or lie inside it, are closed: rigid ones touch,
// compliant ones penetrate.
//
//     v = y' + H p,   p = argmin |v|,  p >= 0,   of the rigid contacts that touch          (impact.hpp, in all modes)
//     eta = Psi^T (y - y_inf - R w),   eta' = Psi^T (v - Y w')                             (38.6)
//
// Which touching contacts stay closed is decided as at any impact; the losses are those of an impact and of truncation.
#include <algorithm>
#include <cmath>

#include "law/law.hpp"
#include "round_off.hpp"

namespace multiphi {

void Law::begin(const Start& start) {
    instant.reached.level = nullptr;  // nothing has been before
    enter_start(start);
    const int count = model_->size();
    bool any_touches = false;
    for (int i = 0; i < count; ++i)
        if (model_->elements[i].is_rigid() && start.states[i] != open_state) any_touches = true;
    for (int i = 0; i < count; ++i) {
        const bool is_rigid = model_->elements[i].is_rigid();
        const int stick = model_->elements[i].stick.state;
        open_key_[i] = is_rigid ? open_state : start.states[i];
        if (any_touches && bears_no_impulse(i) && open_key_[i] >= stick)
            open_key_[i] = std::max(start.states[i], stick + slip_forward);  // slips, in either direction
        striking_[i] = is_rigid && start.states[i] != open_state;
        instant.freed[i] = instant.refused_before[i] = 0;
        instant.asked[i] = no_request;
    }
    const Level* level = &levels_->level(open_key_);
    instant.changes.clear();
    start_loss = Loss();
    after_impact_ = start_;
    bool strikes = false;
    if (any_touches) {
        strikes = strike_start(*level);
        level = entered_.level;
    }
    enter_given(after_impact_, *level, instant.reached);
    instant.first_change = static_cast<int>(instant.changes.size());
    decide();
    instant.first_change = 0;
    instant.transitions += strikes;
    add_losses(after_impact_, start.states, instant.reached, 0.0, instant.loss);
    instant.loss.truncation_strain += start.spring_energy;
    instant.loss += start_loss;
}

// Sets `start_` to the start in the base, with the present w and w'.
void Law::enter_start(const Start& start) {
    const Level& base = levels_->base();
    const int m = base.modes(), q = base.prescribed(), held = base.channels() - q;
    start_.enter(base);
    start_.displacement.head(m) = start.displacement;
    start_.velocity.head(m) = start.velocity;
    start_.displacement.segment(m, q) = inputs_->values();
    start_.velocity.segment(m, q) = inputs_->rates();
    start_.displacement.tail(held) = start.held;
    start_.velocity.tail(held).setZero();
    measure(start_, *inputs_);
}

// Lets the velocity at the start strike the touching contacts: sets `after_impact_`, in all modes, and `entered_`, in the
// level of the contacts that stay closed. Whether this is a transition.
bool Law::strike_start(const Level& open_level) {
    enter_given(start_, open_level, instant.trial);
    strike();
    const bool is_transition = !instant.changes.empty();
    instant.changes.clear();
    const bool rebounds = set_rebound_velocities(start_);
    collide_and_rebound(start_, rebounds, after_impact_, start_loss);
    if (rebounds) repeat_impacts(after_impact_, start_loss);
    record_impact_changes();
    return is_transition;
}

// The displacement of the start and the velocity of a state in the base, in a level, all guards armed. A displacement that
// is round-off of the level's static equilibrium becomes zero.
void Law::enter_given(const State& velocities, const Level& level, State& result) {
    const Transition& transition = levels_->transition(levels_->base(), level);
    mover_.move(start_, transition, velocities, transition, *inputs_, result);
    const int m = levels_->base().modes(), q = level.channels();
    for (int i = 0; i < level.modes(); ++i) {
        double size = mover_.displacement_sizes()[i] + transition.start_sizes(i, q);
        for (int k = 0; k < q; ++k) size += transition.start_sizes(i, k) * std::abs(start_.displacement[m + k]);
        if (std::abs(result.displacement[i]) <= round_off::zero * size) result.displacement[i] = 0.0;
    }
    std::fill(result.phases.begin(), result.phases.end(), Phase::armed);
    result.all_armed = true;
}

}  // namespace multiphi
