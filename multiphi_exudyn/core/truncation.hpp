// Truncation: what the modes left out cost, as far as a run can tell without them.
//
// The run sums the squares of its defects (defect_form.hpp) over its events, and samples the size of its motion:
//
//     energy lost to truncation / largest energy of the run, both without their signs
//     indicator of the motion: sqrt( sum of |d|^2 + |w / Omega|^2, over the mean of |y|^2 )
//
// Each is zero where it is too small for a warning, and nan where it is not known. The thresholds are calibrated on random
// truncated models that are compared with all modes (tests/campaign/truncation_study.py).
#pragma once

#include "law/instant.hpp"
#include "levels.hpp"
#include "motion.hpp"
#include "trajectory.hpp"

namespace multiphi {

// Of the motion: threshold of the truncation warning where every contact that is struck is compliant.
inline constexpr double motion_threshold = 0.03;

// Adds up the squares of the defects of a run; nan where one is not known. A rigid contact that is struck and opens again
// removes more than a defect form holds: if it alone is struck, that part is proportional to the square of its impulse.
class Defects {
  public:
    explicit Defects(Levels& levels) : levels_(&levels) {}

    double sum = 0.0;

    void add_start(const State& start, const State& after, const Instant& instant);
    void add(const Instant& instant);

  private:
    Levels* levels_;
    Vector displaced_, moved_;
};

// Size of the motion of a run: the mean of |y|^2 and the largest energy, from evenly spaced samples between its start and
// its end. The run samples those in a segment while it has the motion of the segment, from the moment when the truncation
// may be worth a warning.
class MotionSize {
  public:
    static constexpr int samples = 17;  // on 150 random models the root mean square is off by 3 % (standard deviation)

    void begin(double start, double end, double start_square);
    // Samples what lies in the segment of a motion. defects: sum so far; last_decision: its time.
    void sample(Motion& motion, double segment_start, double segment_end, double defects, double last_decision,
                bool is_isolated);
    // Adds the sample of a motion a delay after its state.
    void add_sample(Motion& motion, double delay, double weight, bool with_energy);

    bool is_complete(double end) const { return count_ == samples && end_ == end; }
    double mean_square() const { return mean_square_; }
    double largest_energy() const { return largest_energy_; }
    double start_square() const { return start_square_; }

  private:
    void add(double weight, bool with_energy);

    double first_ = 0.0, end_ = 0.0, start_square_ = 0.0, mean_square_ = 0.0, largest_energy_ = 0.0;
    int count_ = 0;
    State sampled_;
};

// What a ledger may leave open, of the energies turned over.
inline constexpr double open_ledger = 1e-6;

// The share of energy lost in the largest energy of a run, zero where it is too small for a warning.
double lost_share(double lost, double largest);
// The indicator of a sum of defects and the mean of |y|^2.
double indicator(double defects, double mean_square);

// Sets the estimates from the other numbers; threshold: of the indicator for a warning.
void estimate_truncation(Truncation& truncation, const Ledger& ledger, double threshold);

// Whether the ledger is closed and friction, damping and impacts have taken energy; `energy`: total energy of the last state.
// Segments whose works are left out are missing.
bool is_balanced(const Ledger& ledger, double energy);

}  // namespace multiphi
