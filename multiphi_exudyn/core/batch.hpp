// Batch: runs of one model from many starts, on several threads. A run is the same, to the bit, alone or among others.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "run.hpp"
#include "trajectory.hpp"

namespace multiphi {

struct BatchRun {
    std::shared_ptr<Trajectory> trajectory;
    std::optional<FinalState> final_state;
    bool is_complete = false;  // it has reached the end; else it is to be run alone, which tells why
};

// Runs from starts at a time to an end [s].
std::vector<BatchRun> run_batch(const std::shared_ptr<Levels>& levels, const std::vector<Start>& starts,
                                const Chatter& chatter, double time, double end, int threads);

// Displacements (runs, points, times) of points at times [s]; rows: of every level visited, (points, 2 n + 1), which act
// on (xi, xi', 1).
std::vector<double> sample_batch(const std::shared_ptr<Levels>& levels,
                                 const std::vector<std::shared_ptr<Trajectory>>& trajectories,
                                 const std::map<Key, Matrix>& rows, const std::vector<double>& times, int threads);

}  // namespace multiphi
