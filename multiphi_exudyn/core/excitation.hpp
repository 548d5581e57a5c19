// Excitation: the time-varying loads and moving supports of a run, as channels w_k(t) (eqs. 38.1, 38.4).
//
//     load          f = ... + b_k w_k               b_k a pattern (m,)
//     moving stop   g_i = h_i.x + gap_i - s_ik w_k
//     w(t_i + s) = Re sum_j exp(mu_j s) sum_d a_jd s^d      on each interval of time, from its start t_i
//
// The first channels are functions of time (prescribed); the others are held: stick positions of friction, and forces
// that others hold on the structure, which only transitions or their owner change.
#pragma once

#include <limits>
#include <vector>

#include "linear_algebra.hpp"

namespace multiphi {

// Terms exp(rate s) sum_d coefficients_d s^d of all prescribed channels: coefficients (D + 1, q).
struct Term {
    Complex rate;
    ComplexMatrix coefficients;
};

// A function of time, piece by piece: exp(rates_i s) sum_d coefficients_id s^d from breaks_i on; zero outside.
struct TimeFunction {
    std::vector<double> breaks;   // (k + 1,) [s]
    std::vector<Complex> rates;   // (k,)
    ComplexMatrix coefficients;   // (k, D + 1)
};

// A rate of the channels' terms, and the largest number of coefficients that a term of this rate has.
struct Carrier {
    Complex rate;
    int powers = 1;
};

// Intervals of time in which every channel stays on one piece of its time function; terms are made when asked for.
class Intervals {
  public:
    Intervals() = default;
    Intervals(std::vector<TimeFunction> functions, double start, double until);

    int count() const { return static_cast<int>(starts_.size()); }
    double start(int interval) const { return starts_[interval]; }
    double end(int interval) const { return ends_[interval]; }
    int at(double time) const;  // the interval that holds a time

    // The terms of an interval, as they are at its start.
    void terms(int interval, std::vector<Term>& result) const;
    // Of the terms of all intervals, each rate once.
    const std::vector<Carrier>& carriers() const { return carriers_; }

  private:
    void list_carriers(double start, double until);

    std::vector<TimeFunction> functions_;
    std::vector<Carrier> carriers_;
    std::vector<double> starts_, ends_;
};

struct Excitation {
    Vector static_load;               // (m,)
    Matrix patterns;                  // b (m, q)
    Matrix stops;                     // s (l, q)
    int prescribed = 0;               // number of channels that are functions of time
    double highest_frequency = 0.0;   // of these [Hz]
    bool is_isolated = false;         // no load acts, so the energy never exceeds that at the start
    std::vector<int> rate_of;         // of each channel the one that is its derivative, -1 where none is needed
    int steady = -1;                  // the channel that is always one, -1 for none
    Intervals intervals;

    int channels() const { return static_cast<int>(patterns.cols()); }
};

// The channels that are functions of time at an instant: w, w', w'' with the sizes of their terms, and the terms of the
// motion that begins there. `horizon`, a power of two above the remaining time, is the unit of its powers of time.
class Inputs {
  public:
    explicit Inputs(const Excitation& excitation);

    int count() const { return excitation_->prescribed; }
    int interval() const { return interval_; }
    double age() const { return age_; }          // [s] since the start of the interval
    double horizon() const { return horizon_; }  // [s]
    double interval_end() const;                 // [s], infinite without prescribed channels
    const std::vector<Term>& terms() const { return terms_; }
    const Vector& values() const { return values_; }                // w (q,)
    const Vector& rates() const { return rates_; }                  // w'
    const Vector& accelerations() const { return accelerations_; }  // w''
    const Vector& value_sizes() const { return value_sizes_; }
    const Vector& rate_sizes() const { return rate_sizes_; }
    const Vector& acceleration_sizes() const { return acceleration_sizes_; }

    // Sets the channels to a time `age` after the start of an interval, for a motion from `time` to `until`.
    void set(int interval, double age, double time, double until);
    // Moves the channels of the present interval on by a delay >= 0, for a motion from `time` to `until`.
    void advance(double delay, double time, double until);
    void set_horizon(double horizon) { horizon_ = horizon; }

  private:
    void translate(double delay, double time, double until);
    void evaluate();

    const Excitation* excitation_;
    int interval_ = 0;
    double age_ = 0.0, horizon_ = 1.0;
    std::vector<Term> terms_;
    Vector values_, rates_, accelerations_, value_sizes_, rate_sizes_, acceleration_sizes_;
};

}  // namespace multiphi
