#include "block_search.hpp"

#include <algorithm>

namespace multiphi {

namespace {

constexpr double roomy = 24.0;  // of the remainder: above it at the end of an interval the next one may be wider

}  // namespace

std::optional<Fall> BlockSearch::first(const Exponentials& exponentials, const SearchedSignals& signals,
                                       const SignalBounds& bounds, double start, double distance, double horizon,
                                       bool has_factors, CandidateInterval& candidate) {
    begin(exponentials, signals, bounds, start);
    if (!has_factors) set_factors(exponentials, distance);
    const double end = horizon - start;
    int doublings = 0, index = 0;
    while (index < intervals_of_block && index * distance < end) {
        while (index + (1 << doublings) > intervals_of_block) --doublings;
        const double left = index * distance, width = distance * (1 << doublings);
        advance(exponentials, &factors_[doublings * p_], start + left + width);
        sample(signals, bounds, phi_right_, right_);
        ++candidate.evaluations;
        const Room found = room(signals, bounds, width, index == 0);
        if (found == Room::candidate) {
            if (doublings > 0) {
                --doublings;
                continue;
            }
            const std::optional<Fall> fall =
                first_in_interval(exponentials, signals, bounds, start, left, width, end, candidate);
            if (fall) return fall;
        }
        std::swap(phi_left_, phi_right_);
        std::swap(left_, right_);
        index += 1 << doublings;
        if (found == Room::wider && doublings < widest) ++doublings;
    }
    return std::nullopt;
}

// Sets the coefficients from the block's start, and its first exponentials and samples.
void BlockSearch::begin(const Exponentials& exponentials, const SearchedSignals& signals, const SignalBounds& bounds,
                        double start) {
    const int p = p_ = exponentials.size(), count = signals.count;
    if (static_cast<int>(phi_left_.size()) < p) {
        phi_left_.resize(p);
        phi_right_.resize(p);
        factors_.resize((1 + widest) * p);
    }
    if (static_cast<int>(left_.size()) < count) {
        left_.resize(count);
        right_.resize(count);
    }
    if (static_cast<int>(coefficients_.size()) < count * p) {
        coefficients_.resize(count * p);
        slope_coefficients_.resize(count * p);
    }
    exponentials.evaluate(start, exponentials.unit, phi_left_.data());
    for (int s = 0; s < count; ++s) {
        const Complex* c = signals.row(s);
        for (int j = 0; j < p; ++j) coefficients_[s * p + j] = product(c[j], phi_left_[j]);
        if (!bounds[s].opposite) exponentials.differentiate(&coefficients_[s * p], &slope_coefficients_[s * p]);
    }
    exponentials.evaluate(0.0, start, phi_left_.data());
    sample(signals, bounds, phi_left_, left_);
}

void BlockSearch::set_factors(const Exponentials& exponentials, double distance) {
    exponentials.evaluate(distance, exponentials.unit, factors_.data());
    for (int k = 0; k < widest * p_; ++k) factors_[p_ + k] = product(factors_[k], factors_[k]);
}

// Sets the exponentials at the right end: those of power zero times their factors, the others times t / T.
void BlockSearch::advance(const Exponentials& exponentials, const Complex* factors, double t) {
    if (exponentials.pure) {
        for (int j = 0; j < p_; ++j) phi_right_[j] = product(phi_left_[j], factors[j]);
        return;
    }
    const double ratio = t / exponentials.unit;
    Complex phi = 0.0;
    for (int j = 0; j < p_; ++j) {
        phi = exponentials.powers[j] > 0 ? phi * ratio : product(phi_left_[j], factors[j]);
        phi_right_[j] = phi;
    }
}

// Sets s and s' of every signal at exponentials phi.
void BlockSearch::sample(const SearchedSignals& signals, const SignalBounds& bounds, const std::vector<Complex>& phi,
                         std::vector<Sample>& result) const {
    double value = 0.0, slope = 0.0;
    for (int s = 0; s < signals.count; ++s) {
        if (bounds[s].opposite) {
            value = -value;
            slope = -slope;
        } else {
            const Complex *c = &coefficients_[s * p_], *c_t = &slope_coefficients_[s * p_];
            value = slope = 0.0;
            for (int j = 0; j < p_; ++j) {
                value += real_product(c[j], phi[j]);
                slope += real_product(c_t[j], phi[j]);
            }
        }
        result[s] = {signals.constants[s] + value, slope};
    }
}

// The least of all signals.
BlockSearch::Room BlockSearch::room(const SearchedSignals& signals, const SignalBounds& bounds, double width,
                                    bool is_first) const {
    Room least = Room::wider;
    for (int s = 0; s < signals.count; ++s) {
        least = std::min(least, room(signals, bounds, s, width, is_first));
        if (least == Room::candidate) break;
    }
    return least;
}

// In a block's first interval a signal may rise from zero: then the Bernstein coefficients of (s - s0 (1 - u)^3) / u,
// u = t / h, exceed the remainder, at most h^4/162 max|s^(4)| u.
BlockSearch::Room BlockSearch::room(const SearchedSignals& signals, const SignalBounds& bounds, int s, double width,
                                    bool is_first) const {
    const double left = left_[s].value, right = right_[s].value;
    const double rise = width * left_[s].slope, right_rise = width * right_[s].slope;
    const double spread = width * width * width * width * bounds[s].of[4];
    const double lowest = std::min(std::min(left, left + rise / 3), std::min(right - right_rise / 3, right));
    if (!(lowest > cubic_remainder * spread)) {
        if (!is_first) return Room::candidate;
        const bool is_below = left < -negligible_size(bounds[s].of[0], signals.constants[s], signals.noises[s]);
        const double lowest_lifted = std::min(std::min(3 * left + rise, 1.5 * right - right_rise / 2), right);
        if (is_below || !(lowest_lifted > lifted_remainder * spread)) return Room::candidate;
    }
    return right + right_rise > roomy * cubic_remainder * spread ? Room::wider : Room::no_root;
}

// The first descent in an interval, not later than the block's `end`; the last of simultaneous ones.
std::optional<Fall> BlockSearch::first_in_interval(const Exponentials& exponentials, const SearchedSignals& signals,
                                                   const SignalBounds& bounds, double start, double left,
                                                   double width, double end, CandidateInterval& candidate) {
    int falling = -1;
    double earliest = end;
    const bool is_first = left == 0.0;
    for (int s = 0; s < signals.count; ++s) {
        if (room(signals, bounds, s, width, is_first) != Room::candidate || !(left < earliest)) continue;
        candidate.set_signal(exponentials, &coefficients_[s * p_], signals.constants[s], signals.noises[s], bounds[s],
                             start);
        candidate.combine_ends(phi_left_.data(), phi_right_.data());
        if (candidate.has_descent(left, left + width) && candidate.root() <= earliest) {
            falling = s;
            earliest = candidate.root();
        }
    }
    if (falling < 0) return std::nullopt;
    return Fall{falling, start + earliest};
}

}  // namespace multiphi
