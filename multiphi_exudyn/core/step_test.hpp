// Step test: whether no event can have occurred within a step of another solver, from the states at its two ends.
//
//     rows x > max |S z'|,   x = (q, q', q'', 1, f, stick positions, w, w'),   S z' = norm (q, q', q'')
//
// Each row is a Bernstein coefficient of a signal's cubic interpolant, or a value of a signal, divided by the factor of
// |S z'| in the bound of what the interpolant leaves out (exudyn_plugin/step_test.py computes them).
// The test may fail without an event, but it never passes with one.
#pragma once

#include <vector>

#include "linear_algebra.hpp"

namespace multiphi {

// The rows that have to be exceeded in one level. The first ones hold at the end of a step, the last ones at its start:
//
//     rows 0 ... end_count - 1 at the end,   rows first_at_start ... at the start
struct StepConditions {
    Matrix rows;               // (k, n)
    int end_count = 0, first_at_start = 0;
    Matrix norm;               // (2 s, 3 s)
    int points = 0, held = 0, channels = 0;  // entries of x for f, for stick positions, and for w with w'
    bool has_point_forces = false;           // whether f is in any row
};

// Where the solver keeps its present state: q, q', q'' (s,) and the multipliers, f among them at these indices.
struct SolverState {
    const double *displacement = nullptr, *velocity = nullptr, *acceleration = nullptr, *multipliers = nullptr;
    std::vector<int> point_forces;
};

class StepTest {
  public:
    StepTest(StepConditions conditions, double step, double rounding, SolverState state);

    // Begins a step at a time [s] with x; while a guard is not armed the test fails, so that its step is looked at.
    void begin(double time, const Vector& x, bool all_armed);
    // Sets w, w' at the end t [s] of the present step, which must not jump in it.
    void set_end_channels(double t, const Vector& channels);
    // Whether no event can have occurred in the step that ends at t [s]; its end is then the start of the next step.
    bool is_step_clear(double t);

    double time() const { return time_; }  // start of the present step [s]
    // (q, q', q'', 1, f) at the start of the present step.
    Vector start() const;

  private:
    double norm_of(const Vector& x) const;
    double half_change() const;

    StepConditions conditions_;
    double step_, rounding_;
    SolverState state_;
    int size_, width_;
    Vector start_, end_;                // x
    double time_, announced_end_;
    double clearance_ = 0.0;            // smallest row at the start
    double speed_ = 0.0;                // |S z'| there
};

}  // namespace multiphi
