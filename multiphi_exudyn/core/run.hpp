// Run: a motion from event to event (eqs. 38.3, 38.6). There is no time step.
//
// Within a level the motion is a sum of exponentials; the next event is the certified first descent of a few of them
// (search.hpp); the law gives the state that follows. A failure ends the run at its instant, with its cause.
#pragma once

#include <memory>
#include <vector>

#include "excitation.hpp"
#include "law/law.hpp"
#include "levels.hpp"
#include "motion.hpp"
#include "search.hpp"
#include "trajectory.hpp"
#include "truncation.hpp"
#include "work.hpp"

namespace multiphi {

// More events in a short time than modes and loads can follow: the last `window` decisions took less than
// window / allowed periods of the fastest mode or load, or no time at all.
class Chatter {
  public:
    Chatter(int window, double allowed) : window_(window), allowed_(allowed) {}

    void begin(double time);
    void add(double time, double highest_frequency, bool is_rebound_only);
    bool is_chatter(double time, double& elapsed, double& highest_frequency) const;
    double last_decision() const { return last_decision_; }

    Exchanges exchanges;

  private:
    struct Decision {
        double time_before = 0.0, highest_frequency = 0.0;
    };
    int window_;
    double allowed_;
    long decisions_ = 0;
    double last_decision_ = 0.0;
    std::vector<Decision> ring_;
};

// A state as the owner of held forces knows it: the modes about their centre without these forces, then the
// displacements that links hold.
struct StepState {
    Key key;
    Vector displacement, velocity;
    std::vector<Phase> phases;
};

class Run {
  public:
    enum class Ending { end_reached, event };

    Run(std::shared_ptr<Levels> levels, Chatter chatter, double time);

    // One of these two is first. The first state, and the events at the start, are made when the run advances.
    void begin(Start start);
    // `loads_differ`: elements may change their states at once; else the motion goes on as if it had not been interrupted.
    void go_on_from(const FinalState& state, bool loads_differ);

    // Begins anew at a state and a time [s]; the record so far is dropped. Chatter is looked for in all that has been.
    void begin_step(double time, const StepState& state);
    StepState step_state(const State& state) const;
    // The state right before the last decision, or that at the end.
    const State& reached() const { return law_.instant.reached; }
    Chatter& chatter() { return chatter_; }
    double& defects() { return defects_.sum; }  // the sum so far, which may begin anew
    Law& law() { return law_; }

    // Advances to `end` [s], or to the first event. Throws NumericalFailure, or the LevelFailure of a level; the
    // trajectory then ends at the instant of the failure.
    Ending advance(double end, bool stop_at_event);

    double time() const { return time_; }
    const State& current() const { return current_; }
    bool has_started() const { return has_started_; }
    FinalState final_state() const;
    Trajectory& trajectory() { return *trajectory_; }
    std::shared_ptr<Trajectory> shared_trajectory() const { return trajectory_; }
    void sum_works(bool sums) { sums_works_ = sums; }
    // Other runs use the levels at the same time, so that none is forgotten.
    void share_levels() { shares_levels_ = true; }
    // The largest record [bytes]; a run that needs more ends.
    void limit_record(std::size_t bytes) { most_bytes_ = bytes; }
    // Whether energies at the end and the truncation estimate are wanted.
    void keep_summary(bool keeps) { keeps_summary_ = keeps; }

  private:
    Ending run_segments(double end, bool stop_at_event);
    void begin_run();
    void continue_run();
    void hold_again();
    void begin_next_interval(double end);
    void advance_segment(double end);
    void keep_segment(double instant_time, double age, double armed_after, double horizon, bool is_summed);
    void keep_events();
    void finish();
    double square_of_start() const;
    void bound_levels();

    std::shared_ptr<Levels> levels_;
    std::shared_ptr<Trajectory> trajectory_;
    Inputs inputs_;
    Law law_;
    Motion motion_;
    SearchedSignals signals_;
    std::vector<Watched> watched_;
    DescentSearch search_;
    Chatter chatter_;
    Defects defects_;
    MotionSize motion_size_;
    WorkSums work_sums_;
    State current_;
    Start start_;
    double time_ = 0.0;
    double work_ = 0.0;               // [J] of varying loads and stops at the present instant
    Works works_;                     // of the present segment
    std::vector<Term> terms_before_;  // of the channels at its start
    bool has_started_ = false, goes_on_ = false;
    bool sums_works_ = true, keeps_summary_ = true, shares_levels_ = false;
    std::size_t most_bytes_ = 1ull << 31;  // ten million segments of a small model
    std::size_t segments_checked_ = 0;  // when the memory of the levels was last looked at
};

}  // namespace multiphi
