// Sampler: values of a recorded motion at any times, from the same closed forms as in the run.
//
// A segment is recorded by the state at its start: xi, xi', the interval of the channels and the time in it, and the horizon
// of its powers of time. At evenly spaced times exp(lambda t) is multiplied by a constant factor, and computed exactly every
// few samples.
#pragma once

#include <memory>
#include <vector>

#include "levels.hpp"
#include "motion.hpp"
#include "trajectory.hpp"
#include "work_integrals.hpp"

namespace multiphi {

enum class Side { left, right };  // from which a value at an event is taken

class Sampler {
  public:
    Sampler(std::shared_ptr<Levels> levels, std::shared_ptr<const Trajectory> trajectory);

    // row.(xi, xi', 1) at times (count,) [s] in any order; rows (levels, 2 n + 1) by the trajectory's level numbers.
    void values(const double* times, int count, Side side, const Matrix& rows, double* result);
    // xi and xi' (2, count, width) of segments, times `after` [s] their starts; what a level does not have is zero.
    void states(const int* segments, const double* after, int count, int width, double* result);
    // Mean of |y|^2 and largest energy up to an end [s], from even samples.
    void sizes(double end, double& mean_square, double& largest_energy);
    // Works of segments.
    Works works(const std::vector<int>& segments);

    // The motion of a segment in closed form, until the next call: xi = Re shapes (c phi(t)).
    const Motion& motion(int segment);
    ComplexMatrix shapes() const;  // of that motion (n, p)

    // The last segment that begins at a time or before, from the left before it; at least the first.
    int segment_at(double time, Side side) const;

  private:
    void begin_segment(int segment);
    double even_step(const double* times, int count) const;

    std::shared_ptr<Levels> levels_;
    std::shared_ptr<const Trajectory> trajectory_;
    Inputs inputs_;
    State state_, at_;
    Motion motion_;
    WorkIntegrals work_integrals_;
    int begun_ = -1;
    std::vector<Complex> coefficients_, phi_, factors_;
};

}  // namespace multiphi
