// Batch: many runs on several threads. A run is the same, to the bit, alone or among others.
#pragma once

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

// Runs from starts at a time to an end [s], each in its own levels; runs may have the same ones.
std::vector<BatchRun> run_batch(const std::vector<std::shared_ptr<Levels>>& levels, const std::vector<Start>& starts,
                                const Chatter& chatter, double time, double end, int threads);

}  // namespace multiphi
