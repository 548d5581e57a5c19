// Signals of a motion, bounds of them and of their derivatives, and the sample distance that follows from the bounds.
//
//     s(t) = constant + Re sum_j c_j phi_j(t),   |s^(k)(t)| <= sum_j |c_j^(k)| (t/T)^d_j exp(Re lambda_j t)
//
// c^(k): coefficients of the k-th derivative. An interpolant of a signal differs from it by at most a bound of a
// derivative times a power of the interval's length h; the factors stand below.
// Source: P. J. Davis, Interpolation and Approximation, 1963, ch. 3.
#pragma once

#include <array>
#include <vector>

#include "exponentials.hpp"
#include "linear_algebra.hpp"

namespace multiphi {

inline constexpr double cubic_remainder = 1.0 / 384.0;      // of h^4 max|s^(4)|: cubic Hermite interpolation
inline constexpr double quintic_remainder = 1.0 / 46080.0;  // of h^6 max|s^(6)|: the quintic, with second derivatives
inline constexpr double lifted_remainder = 1.0 / 162.0;     // of h^4 max|s^(4)|: the cubic's divided by u = t / h

inline constexpr int bounded_derivatives = 7;  // s and its derivatives up to the sixth are bounded
inline constexpr int intervals_of_block = 64;  // a search advances by blocks of this many intervals

// Signals s_k(t) = constant_k + Re sum_j c_kj phi_j(t) of one motion, whose first descent through zero is searched.
struct SearchedSignals {
    ComplexMatrix coefficients;     // c, with room for at least (count, p)
    std::vector<double> constants;  // (count,) or longer
    std::vector<double> noises;     // (count,) or longer: how much of each is round-off of what it is made of
    int count = 0;

    // Sets the count, with room for p exponentials. Memory grows and never shrinks; old values are lost where it grows.
    void resize(int new_count, int p);

    Complex* row(int s) { return coefficients.data() + s * coefficients.cols(); }
    const Complex* row(int s) const { return coefficients.data() + s * coefficients.cols(); }
};

// Upper bounds of one signal, without its constant.
struct SignalBound {
    std::array<double, bounded_derivatives> of;  // max |s|, |s'|, ..., |s^(6)|
    bool opposite = false;  // it is the previous signal with the opposite sign, but for its constant
};

// Bounds of all signals on an interval of time.
class SignalBounds {
  public:
    // Sets the bounds on [start, latest].
    void set(const Exponentials& exponentials, const SearchedSignals& signals, double start, double latest);

    const SignalBound& operator[](int s) const { return bounds_[s]; }

    // Whether every constant is larger than the bound of what varies: no signal is ever zero.
    bool below_constants(const SearchedSignals& signals) const;

    // Whether the bounds of the signals and of their highest derivatives are finite.
    bool finite(const SearchedSignals& signals) const;

    // Until when, at most `latest`, the drift of every signal keeps it above zero; `start` for not at all. The drift is
    // the constant and the terms without exponential that are constant or linear in time; the bounds of the other terms
    // hold from `start` on.
    double drift_above(const Exponentials& exponentials, const SearchedSignals& signals, double start,
                       double latest) const;

    // The sample distance of the next block: a power of two whose remainder is `resolution` of the signals, at most the
    // one with which the block covers the remaining time.
    double sample_distance(const SearchedSignals& signals, double remaining, double resolution) const;

  private:
    std::vector<SignalBound> bounds_;
    std::vector<double> envelope_;  // (p,): bounds of |phi_j|
    std::vector<double> fast_;      // (p,): |lambda_j|
    std::vector<double> link_;      // (p,): what a derivative takes over from the next power, per bound of that term
    std::vector<double> sizes_;     // (p + 1,): bounds of the terms of a derivative, and a zero
};

// The size of |s| below which it is round-off of its terms, whose sizes add up to `size`, or of what they are made of.
double negligible_size(double size, double constant, double noise);

// The smallest power of two that is greater than a value.
double power_of_two_above(double value);

}  // namespace multiphi
