// The first descent of signals in a block of intervals, certified as search.hpp says.
//
// The exponentials are advanced from interval to interval by factors; intervals are wider where all signals are far
// from zero. An interval that is not decided is a candidate of every signal that may have a root there.
#pragma once

#include <optional>
#include <vector>

#include "candidate_interval.hpp"
#include "exponentials.hpp"
#include "signal_bounds.hpp"

namespace multiphi {

// A signal that falls through zero, and when [s].
struct Fall {
    int signal;
    double time;
};

class BlockSearch {
  public:
    // The first descent in the block that begins at `start`, not later than the horizon; none if nothing falls.
    // has_factors: the previous block of this motion had the same sample distance.
    std::optional<Fall> first(const Exponentials& exponentials, const SearchedSignals& signals,
                              const SignalBounds& bounds, double start, double distance, double horizon,
                              bool has_factors, CandidateInterval& candidate);

  private:
    static constexpr int widest = 3;  // doublings of an interval where all signals are far from zero

    struct Sample {
        double value, slope;
    };

    // What the ends of an interval say of a signal: it may have a root; it has none; also the next one may be wider.
    enum class Room { candidate, no_root, wider };

    void begin(const Exponentials& exponentials, const SearchedSignals& signals, const SignalBounds& bounds,
               double start);
    void set_factors(const Exponentials& exponentials, double distance);
    void advance(const Exponentials& exponentials, const Complex* factors, double t);
    void sample(const SearchedSignals& signals, const SignalBounds& bounds, const std::vector<Complex>& phi,
                std::vector<Sample>& result) const;
    Room room(const SearchedSignals& signals, const SignalBounds& bounds, double width, bool is_first) const;
    Room room(const SearchedSignals& signals, const SignalBounds& bounds, int s, double width, bool is_first) const;
    std::optional<Fall> first_in_interval(const Exponentials& exponentials, const SearchedSignals& signals,
                                          const SignalBounds& bounds, double start, double left, double width,
                                          double end, CandidateInterval& candidate);

    int p_ = 0;
    std::vector<Complex> coefficients_, slope_coefficients_;  // (count, p) of s and of s', from the block's start
    std::vector<Complex> factors_;                            // (1 + widest, p): over 1, 2, 4, ... sample distances
    std::vector<Complex> phi_left_, phi_right_;               // (p,) at the ends of an interval
    std::vector<Sample> left_, right_;                        // (count,)
};

}  // namespace multiphi
