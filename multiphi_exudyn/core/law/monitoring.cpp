// Monitoring: the signals that a motion is searched for, and the requests when they fall (sentences 1, 5 to 7).
//
// The first descent through zero of a signal, of its negative or of its rate makes a guard request a change, or arms it.
#include <algorithm>
#include <cmath>

#include "law/law.hpp"
#include "round_off.hpp"

namespace multiphi {

void Law::watch(Motion& motion, const std::vector<Phase>& phases, SearchedSignals& signals,
                std::vector<Watched>& watched) {
    const Level& level = motion.level();
    signals.resize(2 * static_cast<int>(level.guards().size()), motion.size());  // at most two of each guard
    signals.count = 0;
    watched.clear();
    for (int k = 0; k < static_cast<int>(level.guards().size()); ++k) {
        const Guard& guard = level.guards()[k];
        if (immovable_[guard.element]) continue;
        if (phases[k] == Phase::held_back && exchanges_->is_held(guard.element, instant.time)) continue;
        if (phases[k] == Phase::armed || phases[k] == Phase::landing) {
            wait_for(motion, guard.signal, 1.0, Of::signal, false, signals);
            watched.push_back({k, true});
            continue;
        }
        wait_for(motion, guard.signal, -1.0, Of::signal, false, signals);
        watched.push_back({k, false});
        if (phases[k] == Phase::recovering) {
            wait_for(motion, guard.signal, 1.0, Of::rate, false, signals);
            watched.push_back({k, true});
        }
        if (phases[k] == Phase::refused) {
            const bool opens_viscous =
                model_->elements[guard.element].kind == Kind::viscous && level.state(guard.element) == open_state;
            wait_for(motion, levels_->entered_signal(level, k), -1.0, Of::signal, opens_viscous, signals);
            watched.push_back({k, true});
        }
    }
}

// Appends a signal, or its rate, times a sign. A start value that is round-off, of its own terms or of the transition
// that has made the state, counts as zero: if the sum of the exponentials, which has a round-off of its own, is below
// zero there, the signal is shifted to start at zero. So is, if `is_shifted`, the force that truncation has left a viscous
// contact at its opening (7).
void Law::wait_for(Motion& motion, const Signal& signal, double sign, Of of, bool is_shifted, SearchedSignals& signals) {
    const State& state = motion.start();
    const Row& row = signal.row;
    const int p = motion.size();
    const int s = signals.count++;
    Complex* coefficients = signals.row(s);
    motion.signal(signal, coefficients);
    double constant = row.constant + held_part(state, signal), begins = row.constant, size = std::abs(row.constant);
    const Vector *displacement = &state.displacement, *velocity = &state.velocity, *scale = &state.displacement_scale;
    if (of == Of::rate) {
        motion.basis().differentiate(coefficients, coefficients);
        displacement = &state.velocity;
        scale = &state.velocity_scale;
        constant = begins = size = 0.0;
    }
    for (Index i = 0; i < row.displacement.size(); ++i) {
        size += std::abs(row.displacement[i]) * (std::abs((*displacement)[i]) + (*scale)[i]);
        begins += row.displacement[i] * (*displacement)[i];
    }
    if (row.depends_on_velocity) {
        if (of == Of::rate) {
            accelerate(state, *inputs_, acceleration_);
            velocity = &acceleration_;
        }
        for (Index i = 0; i < row.velocity.size(); ++i) {
            const double further = of == Of::signal ? state.velocity_scale[i] : 0.0;
            size += std::abs(row.velocity[i]) * (std::abs((*velocity)[i]) + further);
            begins += row.velocity[i] * (*velocity)[i];
        }
    }
    const double mapped = of == Of::rate ? mapped_rate_size(state, signal) : mapped_size(state, signal);
    const bool may_be_zero = sign * begins <= round_off::zero * size;
    const bool is_round_off = std::abs(begins) <= round_off::zero * (size + mapped);
    if (may_be_zero && (is_round_off || is_shifted)) {
        double start = constant;
        for (int j = 0; j < p; ++j)
            if (motion.basis().powers[j] == 0) start += coefficients[j].real();
        constant -= sign * std::min(sign * start, 0.0);
    }
    if (sign < 0.0)
        for (int j = 0; j < p; ++j) coefficients[j] = -coefficients[j];
    signals.constants[s] = sign * constant;
    signals.noises[s] = round_off::clear * size;
}

bool Law::collect_requests(const Motion& motion, const SearchedSignals& signals, const std::vector<Watched>& watched,
                           int found, double time) {
    const Level& level = motion.level();
    std::fill(instant.asked.begin(), instant.asked.end(), no_request);
    if (level.guards().size() > 1) {
        simultaneous(motion.basis(), signals, found, time, fallen_, phi_);
    } else {  // the signals of one contact exclude each other
        fallen_.assign(signals.count, 0);
        fallen_[found] = 1;
    }
    bool any = false;
    for (int s = 0; s < signals.count; ++s) {
        if (!fallen_[s] || !watched[s].requests) continue;
        const Guard& guard = level.guards()[watched[s].guard];
        instant.asked[guard.element] = guard.target;
        any = true;
    }
    return any;
}

}  // namespace multiphi
