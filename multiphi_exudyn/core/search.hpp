// Search: the first descent of signals through zero, certified: no crossing is stepped over.
//
//     s(t) = constant + Re sum_j c_j phi_j(t),   result: the first t in (from, horizon] with s falling below 0
//
// Between two samples a distance h apart s differs from its cubic Hermite interpolant by at most h^4/384 max|s^(4)|,
// and max|s^(k)| <= sum_j |c_j^(k)| (t/T)^d_j exp(Re lambda_j t) (signal_bounds.hpp). A cubic lies above the smallest
// of its Bernstein coefficients:
//
//     min(s0, s0 + h s0'/3, s1 - h s1'/3, s1) > h^4/384 max|s^(4)|
//
// proves that an interval holds no root. Intervals are wider where all signals are far from zero (block_search.hpp);
// one that is not decided is divided until certified monotony or curvature decides, and an inverse Taylor series gives
// the root (candidate_interval.hpp). A touch without crossing is no descent. Where the drift of every signal, its terms
// without exponential, exceeds the bounds of its other terms there is no search. The result does not depend on the
// samples.
//
// Source of the bounds: P. J. Davis, Interpolation and Approximation, 1963, ch. 3; G. Farin, Curves and Surfaces for
// CAGD, ch. 5.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "block_search.hpp"
#include "candidate_interval.hpp"
#include "exponentials.hpp"
#include "linear_algebra.hpp"
#include "round_off.hpp"
#include "signal_bounds.hpp"

namespace multiphi {

inline constexpr double instant = 1e-9;  // of 1 / max |lambda|: a time in which nothing moves but by round-off

// What a search finds.
struct Descent {
    enum class Outcome { none, found, not_finite, too_long };

    Outcome outcome = Outcome::none;
    int signal = -1;                      // the one that falls first
    double time = 0.0;                    // of its fall [s]
    std::array<double, 2> details = {};   // too long: sample distance and remaining time [s]
};

// The search, with the memory it works in: a search that is repeated allocates nothing.
class DescentSearch {
  public:
    // refinement: factor on the density of the samples, on which no result depends.
    explicit DescentSearch(double refinement = 1.0);

    // The first descent in (from, horizon].
    Descent first(const Exponentials& exponentials, const SearchedSignals& signals, double from, double horizon);

    // Of the exponentials, in all searches that did not fail.
    long evaluations() const { return evaluations_; }

  private:
    struct Start {
        double value, slope;
    };

    Descent search(const Exponentials& exponentials, const SearchedSignals& signals, double from, double horizon);
    void set_starts(const Exponentials& exponentials, const SearchedSignals& signals);
    bool stay_above(const SearchedSignals& signals, double horizon) const;
    std::optional<Fall> fall_near_start(const Exponentials& exponentials, const SearchedSignals& signals, double valid);
    bool others_stay_above(int falling, int count, double latest) const;

    double resolution_;  // remainder of a block's intervals, relative to the typical size of the signals
    long evaluations_ = 0;
    SignalBounds bounds_;
    std::vector<Start> starts_;  // (count,): s and s' at t = 0
    BlockSearch block_;
    CandidateInterval candidate_;
};

// Flags the signals that reach zero, falling, at the first descent of `found`. One whose slope is round-off does not
// fall: another contact may keep it at zero. phi: memory, kept by the caller.
void simultaneous(const Exponentials& exponentials, const SearchedSignals& signals, int found, double time,
                  std::vector<char>& fallen, std::vector<Complex>& phi);

// The sign of a signal constant + Re sum_j c_j phi_j just after t = 0, +1 or -1; 0 if it vanishes: that of the first
// derivative, of order `since` or more, that is not round-off of its terms. sizes (p,): what the terms of which each
// coefficient is the sum add up to. Coefficients and sizes are worked in, and lost.
int first_sign(const Exponentials& exponentials, Complex* c, double* sizes, const round_off::Sum& constant, int since);

}  // namespace multiphi
