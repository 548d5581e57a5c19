// Trajectory: the record of a run, segment by segment and event by event. It is all that is needed to evaluate the
// motion at any time, and to go on from its end.
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "energy.hpp"
#include "law/instant.hpp"
#include "level.hpp"
#include "state.hpp"
#include "work.hpp"

namespace multiphi {

// Motion in one level from one instant to the next.
struct Segment {
    int level = 0;                 // number of its key in the trajectory
    int interval = 0;              // of the channels
    double age = 0.0;              // [s] of the interval at the start
    double horizon = 1.0;          // unit of the powers of time [s]
    double entry_work = 0.0;       // [J] of jumps at the start
    double armed_after = 0.0;      // [s] until the last guard is armed
    std::size_t coordinates = 0;   // place of xi, xi' at the start
    std::ptrdiff_t phases = -1;    // place of the phases at the start, -1 where all guards are armed
};

// A change of state of an element; the first event of an instant carries the energies that it has taken.
struct Event {
    double time = 0.0;
    Change change;
    Loss loss;
};

// Entries of the energy ledger [J] up to the end of a trajectory.
struct Ledger {
    Loss at_start, at_events;
    Works works;                   // without the segments left out
    double load_work = 0.0;        // of varying loads and stops, not yet among the works of a segment
    double start_energy = 0.0;     // kinetic and strain energy less the potential of static loads
    double start_potential = 0.0;  // of static loads
    double end_energy = std::numeric_limits<double>::quiet_NaN();  // kinetic and strain energy
    bool is_balanced = false;      // but for the segments left out
};

// What truncation did to the run, and from what that is estimated (truncation.hpp).
struct Truncation {
    double defects = 0.0;           // sum of |d|^2 + |w / Omega|^2, nan where one is not known
    double truncated_energy = 0.0;  // lost at events [J], absolute values
    double start_square = 0.0;      // |y|^2 at the start, zero for a run that goes on from another one
    double mean_square = std::numeric_limits<double>::quiet_NaN();     // of |y|, nan where it has not been sampled
    double largest_energy = std::numeric_limits<double>::quiet_NaN();  // the same [J]
    bool is_isolated = false;       // no load acts: the energy never exceeds that at the start

    // The estimates, each zero where it is too small for a warning, nan where it is not known:
    double energy_share = 0.0;      // energy lost to truncation over the largest energy
    double motion = 0.0;            // indicator of the motion
};

struct Trajectory {
    std::vector<Key> keys;             // of the levels visited, in their order
    std::vector<int> widths;           // n of each
    std::vector<int> guards;           // number of guards of each
    std::vector<double> instants;      // starts of the segments, and the end of the last one [s]
    std::vector<Segment> segments;
    std::vector<double> coordinates;
    std::vector<Phase> phases;
    std::vector<Event> events;
    std::vector<int> left_out;         // segments whose works are not summed
    Ledger ledger;
    Truncation truncation;
    long evaluations = 0;              // of the search
    int transitions = 0;

    int level_number(const Level& level);  // of its key, added if new
    void forget_addresses() { numbers_.clear(); }  // of levels that are forgotten
    std::size_t bytes() const;

  private:
    std::vector<std::pair<const Level*, int>> numbers_;
};

// Where a run ends, so that another one may go on from there.
struct FinalState {
    double time = 0.0;
    Key key;
    Vector displacement, velocity;
    std::vector<Phase> phases;
    int interval = 0;
    double age = 0.0;
};

}  // namespace multiphi
