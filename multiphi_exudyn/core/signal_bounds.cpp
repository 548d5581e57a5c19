#include "signal_bounds.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "round_off.hpp"

namespace multiphi {

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// Whether the coefficients (p,) of a signal are those of another with the opposite sign.
bool are_opposite(const Complex* c, const Complex* other, int p) {
    for (int j = 0; j < p; ++j) {
        if (c[j] != -other[j]) return false;
    }
    return true;
}

}  // namespace

void SearchedSignals::resize(int new_count, int p) {
    if (coefficients.rows() < new_count || coefficients.cols() < p) {
        coefficients.resize(std::max<Index>(coefficients.rows(), new_count), std::max<Index>(coefficients.cols(), p));
        constants.resize(coefficients.rows());
        noises.resize(coefficients.rows());
    }
    count = new_count;
}

// sum_j b_j with b_j = |c_j| (latest / T)^d_j exp(min(Re lambda_j, 0) start + max(Re lambda_j, 0) latest) for s; every
// derivative has |lambda_j| b_j + d_j+1 / latest b_j+1 in place of b_j, where j + 1 has the next power.
void SignalBounds::set(const Exponentials& exponentials, const SearchedSignals& signals, double start, double latest) {
    const int p = exponentials.size();
    if (static_cast<int>(bounds_.size()) < signals.count) bounds_.resize(signals.count);
    if (static_cast<int>(sizes_.size()) < p + 1) {
        for (std::vector<double>* each : {&envelope_, &fast_, &link_}) each->resize(p);
        sizes_.resize(p + 1);
    }
    const double ratio = latest / exponentials.unit;
    double factor = 1.0;
    for (int j = 0; j < p; ++j) {
        const double decay = exponentials.rates[j].real();
        link_[j] = 0.0;
        if (exponentials.powers[j] > 0) {
            factor *= ratio;
            link_[j - 1] = exponentials.powers[j] / latest;
        } else {
            const double exponent = decay * (decay < 0.0 ? start : latest);
            factor = exponent != 0.0 ? exponential(exponent) : 1.0;
        }
        envelope_[j] = factor;
        fast_[j] = modulus(exponentials.rates[j]);
    }
    sizes_[p] = 0.0;  // the last term has no next one
    for (int s = 0; s < signals.count; ++s) {
        SignalBound& bound = bounds_[s];
        const Complex* c = signals.row(s);
        bound.opposite = s > 0 && are_opposite(c, signals.row(s - 1), p);
        if (bound.opposite) {
            bound.of = bounds_[s - 1].of;
            continue;
        }
        if (exponentials.pure) {  // every term by itself
            bound.of.fill(0.0);
            for (int j = 0; j < p; ++j) {
                double size = modulus(c[j]) * envelope_[j];
                for (double& total : bound.of) {
                    total += size;
                    size *= fast_[j];
                }
            }
            continue;
        }
        for (int j = 0; j < p; ++j) sizes_[j] = modulus(c[j]) * envelope_[j];
        for (double& largest : bound.of) {
            double total = 0.0;
            for (int j = 0; j < p; ++j) {
                const double size = sizes_[j];
                total += size;
                sizes_[j] = size * fast_[j] + link_[j] * sizes_[j + 1];
            }
            largest = total;
        }
    }
}

bool SignalBounds::below_constants(const SearchedSignals& signals) const {
    for (int s = 0; s < signals.count; ++s) {
        if (!(signals.constants[s] > bounds_[s].of[0])) return false;
    }
    return true;
}

bool SignalBounds::finite(const SearchedSignals& signals) const {
    for (int s = 0; s < signals.count; ++s) {
        if (!(std::abs(signals.constants[s]) + bounds_[s].of.front() + bounds_[s].of.back() < infinity)) return false;
    }
    return true;
}

double SignalBounds::drift_above(const Exponentials& exponentials, const SearchedSignals& signals, double start,
                                 double latest) const {
    double until = latest;
    for (int s = 0; s < signals.count; ++s) {
        const Complex* c = signals.row(s);
        double value = signals.constants[s], slope = 0.0;
        for (int j = 0; j < exponentials.size(); ++j) {
            if (exponentials.rates[j] != 0.0 || exponentials.powers[j] > 1) {
                value -= modulus(c[j]) * envelope_[j];
            } else if (exponentials.powers[j] == 1) {
                slope += c[j].real() / exponentials.unit;
            } else {
                value += c[j].real();
            }
        }
        if (!(value + slope * start > 0.0)) return start;
        if (!(value + slope * until > 0.0)) until = -value / slope;
    }
    return until;
}

double SignalBounds::sample_distance(const SearchedSignals& signals, double remaining, double resolution) const {
    const double longest = power_of_two_above(remaining / intervals_of_block);
    double step = infinity;
    for (int s = 0; s < signals.count; ++s) {
        const double fourth = bounds_[s].of[4];
        if (fourth > 0.0) {
            const double wanted = resolution * (std::abs(signals.constants[s]) + bounds_[s].of[0]) / cubic_remainder;
            const double distance = std::sqrt(std::sqrt(wanted / fourth));
            if (distance > 0.0) step = std::min(step, distance);  // zero after underflow: no limit
        }
    }
    return step < infinity ? std::min(longest, power_of_two_above(step) / 2) : longest;
}

double negligible_size(double size, double constant, double noise) {
    return std::max(round_off::zero * (size + std::abs(constant)), noise);
}

double power_of_two_above(double value) {
    int exponent = 0;
    std::frexp(value, &exponent);
    return std::ldexp(1.0, exponent);
}

}  // namespace multiphi
