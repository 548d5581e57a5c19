// Switching: compliant contacts change, rigid ones open, force laws go on to other segments (sentences 3, 4, 7, 8).
#include <algorithm>

#include "law/law.hpp"

namespace multiphi {

void Law::switch_states(const Requests& requests) {
    const int count = model_->size();
    targets_ = requests;
    drop_redundant_stick(targets_);
    // The first requests that are admitted together are granted; where none of several is, the first one admitted alone.
    Requests singles;
    int position = -1;
    while (true) {
        const int target_count =
            count - static_cast<int>(std::count(targets_.begin(), targets_.end(), no_request));
        const int denied = try_targets();
        if (denied == 0) {
            open_and_enter();
            return;
        }
        if (denied < target_count) {
            for (int i = 0; i < count; ++i)
                if (denied_[i]) targets_[i] = no_request;
            continue;
        }
        if (target_count > 1) {
            singles = targets_;
            position = 0;
        }
        while (0 <= position && position < count && singles[position] == no_request) ++position;
        if (position < 0 || position >= count) break;
        std::fill(targets_.begin(), targets_.end(), no_request);
        targets_[position] = singles[position];
        ++position;
    }
    for (int i = 0; i < count; ++i) denied_[i] = requests[i] != no_request;
    update_phases(instant.trial, &denied_);
}

// Tries the changes to the targets: `candidate_` becomes the state in the level with them.
int Law::try_targets() {
    const State& trial = instant.trial;
    key_ = trial.level->key();
    for (int i = 0; i < model_->size(); ++i)
        if (targets_[i] != no_request) key_[i] = targets_[i];
    transfer(trial, key_, candidate_);
    update_phases(candidate_, nullptr);
    int denied = 0;
    for (int i = 0; i < model_->size(); ++i) {
        denied_[i] = targets_[i] != no_request && !is_unconditional(i, targets_[i]) && is_denied(candidate_, i) &&
                     !would_pull_if_closed(candidate_, i);
        denied += denied_[i];
    }
    return denied;
}

bool Law::is_unconditional(int element, int requested) const {
    const Level& level = *instant.trial.level;
    for (int k = level.first_guard(element); k < level.end_guard(element); ++k)
        if (level.guards()[k].target == requested && multiphi::is_unconditional(level.guards()[k].rule)) return true;
    return false;
}

bool Law::would_pull_if_closed(const State& state, int element) {
    const Level& level = *state.level;
    if (model_->elements[element].kind != Kind::viscous || level.state(element) != open_state) return false;
    const Signal& signal = levels_->entered_signal(level, level.first_guard(element));
    int sign = signal_sign(state, signal, mapped_size(state, signal));
    if (sign == 0) sign = first_derivative_sign(state, signal, 0);
    if (sign > 0) sign = rate_sign(state, signal, *inputs_);
    return sign <= 0;
}

// Enters `candidate_` with the changes to the targets. A rigid contact that opens loses its velocity towards its stop by an
// impulse.
void Law::open_and_enter() {
    touching_.clear();
    for (int i = 0; i < model_->size(); ++i)
        if (targets_[i] == open_state && model_->elements[i].is_rigid()) touching_.push_back(i);
    std::vector<double> pushed(model_->size(), 0.0);
    const State* entered = &candidate_;
    if (!touching_.empty()) {
        impact_.collide(candidate_, touching_, 0, nullptr, nullptr, *inputs_, struck_, impulses_,
                        instant.transition_loss);
        if (!impact::same_velocity(candidate_, struck_))
            for (std::size_t k = 0; k < touching_.size(); ++k) pushed[touching_[k]] = impulses_[k];
        entered = &struck_;
    }
    for (int i = 0; i < model_->size(); ++i)
        if (targets_[i] != no_request) record_change(i, targets_[i], pushed[i]);
    enter(*entered);
}

void Law::set_requested_states(Requests& requests) {
    const State& trial = instant.trial;
    const Level& level = *trial.level;
    for (const Guard& guard : level.guards()) {
        if (!guard.by_velocity || requests[guard.element] != guard.target) continue;
        const Signal& velocity = guard.by_velocity->velocity;
        const double size = impact::velocity_size(trial, velocity.row.velocity.data());
        const int sign = signal_sign(trial, velocity, size);
        if (sign != 0) requests[guard.element] = sign > 0 ? guard.by_velocity->forward : guard.by_velocity->backward;
    }
    for (int i = 0; i < model_->size(); ++i) {
        if (requests[i] == no_request || model_->elements[i].knots.first_link == 0) continue;
        const int segment = segment_at(trial, i);
        if (segment != level.state(i)) requests[i] = segment;
    }
}

int Law::segment_at(const State& state, int element) const {
    const Knots& knots = model_->elements[element].knots;
    int passed = 0;
    while (passed < knots.above && gap(state, knots.first_link + passed) < 0.0) ++passed;
    if (passed > 0) return passed;
    while (passed < knots.below && gap(state, knots.first_link + knots.above + passed) < 0.0) ++passed;
    return passed > 0 ? knots.above + passed : 0;
}

}  // namespace multiphi
