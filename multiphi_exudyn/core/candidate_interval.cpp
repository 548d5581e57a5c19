#include "candidate_interval.hpp"

#include <algorithm>
#include <cmath>

#include "round_off.hpp"

namespace multiphi {

namespace {

constexpr double narrowest_share = 1e-13;  // of an interval's end in its block: narrower intervals are not divided
constexpr double time_round_off = 1e-15;   // of the time itself: accuracy of a root
constexpr int most_steps = 100;            // towards a root; a dozen is many
constexpr double edge = 0.01;              // of an interval: an estimate of a root keeps away from both ends

double smallest(double a, double b, double c, double d) { return std::min(std::min(a, b), std::min(c, d)); }

// The root of a monotone function as a fraction of its interval, by inverse cubic Hermite interpolation, from the
// function and its derivative at both ends.
double estimated_root(const double* at_left, const double* at_right, double width) {
    const double rise = at_right[0] - at_left[0], slope_left = at_left[1], slope_right = at_right[1];
    double s = rise != 0.0 ? -at_left[0] / rise : 0.5;
    if (slope_left * rise > 0.0 && slope_right * rise > 0.0) {
        const double toward_left = rise / (slope_left * width), toward_right = rise / (slope_right * width);
        s = s * s * (3 - 2 * s) + s * (1 - s) * ((1 - s) * toward_left - s * toward_right);
    }
    return std::min(std::max(s, edge), 1.0 - edge);
}

}  // namespace

void CandidateInterval::set_signal(const Exponentials& exponentials, const Complex* c, double constant, double noise,
                                   const SignalBound& bound, double origin) {
    const int p = exponentials.size();
    exponentials_ = &exponentials;
    bound_ = &bound;
    constant_ = constant;
    origin_ = origin;
    noise_ = {negligible_size(bound.of[0], constant, noise), round_off::zero * bound.of[1],
              round_off::zero * bound.of[2]};
    if (static_cast<int>(phi_.size()) < p) {
        phi_.resize(p);
        coefficients_.resize(sampled * p);
    }
    std::copy(c, c + p, coefficients_.begin());
    for (int k = 1; k < sampled; ++k) {
        exponentials.differentiate(&coefficients_[(k - 1) * p], &coefficients_[k * p]);
    }
}

void CandidateInterval::sample_ends(double left, double right) {
    sample_at(left, left_);
    sample_at(right, right_);
}

void CandidateInterval::combine_ends(const Complex* phi_left, const Complex* phi_right) {
    combine(phi_left, left_);
    combine(phi_right, right_);
}

bool CandidateInterval::has_descent(double left, double right) {
    const double narrowest = narrowest_share * right;
    int depth = 0;
    while (true) {
        const Decision decision = decide(left, right, narrowest);
        if (decision == Decision::descent) return true;
        if (decision == Decision::undecided) {
            later_[depth] = {right, right_};
            ++depth;
            right = (left + right) / 2;
            sample_at(right, right_);
        } else {
            if (depth == 0) return false;
            --depth;
            left = right;
            left_ = right_;
            right = later_[depth].right;
            right_ = later_[depth].at_right;
        }
    }
}

// Sets the signal and its derivatives at time u after its origin.
void CandidateInterval::sample_at(double u, Derivatives& result) {
    exponentials_->evaluate(u, origin_ + u, phi_.data());
    combine(phi_.data(), result);
    ++evaluations;
}

// Sets the signal and its derivatives at exponentials phi.
void CandidateInterval::combine(const Complex* phi, Derivatives& result) const {
    const int p = exponentials_->size();
    const Complex* c = coefficients_.data();
    for (double& each : result) {
        double value = 0.0;
        for (int j = 0; j < p; ++j) value += real_product(c[j], phi[j]);
        each = value;
        c += p;
    }
    result[0] += constant_;
}

// Decides an interval by bounds of s, s', s''; in a descent the root is set.
CandidateInterval::Decision CandidateInterval::decide(double left, double right, double narrowest) {
    const double width = right - left, noise = noise_[0];
    const double low = lowest_value(1.0, width), minus_high = lowest_value(-1.0, width);
    if (low > 0.0 || std::min(low, minus_high) >= -noise || rises(width)) return Decision::no_descent;
    if (left_[0] < -noise) {
        root_ = left;
        return Decision::descent;
    }
    if (lowest_derivative(1, 1.0, width) > 0.0) return Decision::no_descent;
    const bool falls = lowest_derivative(1, -1.0, width) > 0.0 || width < narrowest ||
                       lowest_derivative(2, -1.0, width) > 0.0;
    if (falls && right_[0] < -noise) {
        find_root(0, left, right, right_);
        return Decision::descent;
    }
    if (falls) return Decision::no_descent;
    if (lowest_derivative(2, 1.0, width) > 0.0) return decide_convex(left, right);
    return Decision::undecided;
}

// Decides a convex signal: a root lies before the minimum, if that is below zero. An estimate of the minimum is enough
// where s is below zero there, or where the tangent is above zero everywhere.
CandidateInterval::Decision CandidateInterval::decide_convex(double left, double right) {
    const double noise = noise_[0];
    if (left_[1] >= -noise_[1]) return Decision::no_descent;
    Derivatives lower = right_;
    if (right_[1] > 0.0 && lower[0] >= -noise) {
        double t = left + (right - left) * estimated_root(&left_[1], &right_[1], right - left);
        sample_at(t, lower);
        if (lower[0] > std::abs(lower[1]) * (right - left)) return Decision::no_descent;
        if (lower[0] >= -noise) {
            find_root(1, left, right, right_);
            t = root_;
            sample_at(t, lower);
        }
        right = t;
    }
    if (lower[0] >= -noise) return Decision::no_descent;
    find_root(0, left, right, lower);
    return Decision::descent;
}

// A lower bound of sign times the signal: least Bernstein coefficient of the quintic minus its remainder.
double CandidateInterval::lowest_value(double sign, double width) const {
    const double first = sign * width / 5, second = sign * width * width / 20;
    const double left = sign * left_[0], right = sign * right_[0];
    const double inner_left = left + first * left_[1], inner_right = right - first * right_[1];
    const double middle_left = left + 2 * first * left_[1] + second * left_[2];
    const double middle_right = right - 2 * first * right_[1] + second * right_[2];
    const double remainder = quintic_remainder * width * width * width * width * width * width * bound_->of[6];
    return std::min(smallest(left, right, inner_left, inner_right), std::min(middle_left, middle_right)) - remainder;
}

// The same of sign times a derivative, by the cubic.
double CandidateInterval::lowest_derivative(int order, double sign, double width) const {
    const double left = sign * left_[order], right = sign * right_[order];
    const double inner_left = left + sign * width * left_[order + 1] / 3;
    const double inner_right = right - sign * width * right_[order + 1] / 3;
    const double remainder = cubic_remainder * width * width * width * width * bound_->of[order + 4];
    return smallest(left, right, inner_left, inner_right) - remainder;
}

// Whether the signal starts at zero or above and stays above zero: by s / t as in a block's first interval, or by the
// first derivative that is not round-off, with Taylor's remainder.
bool CandidateInterval::rises(double width) const {
    if (left_[0] < -noise_[0]) return false;
    const double inner_left = left_[0] + width * left_[1] / 3, inner_right = right_[0] - width * right_[1] / 3;
    const double spread = width * width * width * width * bound_->of[4];
    if (std::min(std::min(3 * inner_left, 1.5 * inner_right), right_[0]) > lifted_remainder * spread) return true;
    for (int order = 1; order < 4; ++order) {
        if (left_[order] > bound_->of[order + 1] * width) return true;
        if (order < 3 && left_[order] < -noise_[order]) return false;
    }
    return false;
}

// Finds the root in [left, right] of the signal (order 0, falling) or of its derivative (order 1, rising): by inverse
// Taylor series to third order, kept inside the bracket, from inverse Hermite interpolation.
void CandidateInterval::find_root(int order, double left, double right, const Derivatives& at_right) {
    const double sign = order == 0 ? 1.0 : -1.0, tolerance = time_round_off * right;
    Derivatives point;
    double t = left + (right - left) * estimated_root(&left_[order], &at_right[order], right - left);
    for (int step = 0; step < most_steps; ++step) {
        sample_at(t, point);
        const double value = point[order], slope = point[order + 1];
        if (sign * value >= 0.0) {
            left = t;
        } else {
            right = t;
        }
        double next_t = (left + right) / 2;
        if (slope != 0.0) {
            const double newton = value / slope;
            const double c2 = point[order + 2] / (2 * slope), c3 = point[order + 3] / (6 * slope);
            const double improved =
                t - newton - c2 * newton * newton - (2 * c2 * c2 - c3) * newton * newton * newton;
            const double truncated =
                5 * std::abs(c2) * (c2 * c2 + std::abs(c3)) + bound_->of[order + 4] / (24 * std::abs(slope));
            if (truncated * newton * newton * newton * newton <= tolerance || std::abs(newton) <= tolerance) {
                t = std::min(std::max(improved, left), right);
                break;
            }
            if (left < improved && improved < right) next_t = improved;
        }
        t = next_t;
    }
    root_ = t;
}

}  // namespace multiphi
