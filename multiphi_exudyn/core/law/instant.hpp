// Instant: what the law decides at one instant of time, and what it has decided so far.
#pragma once

#include <vector>

#include "energy.hpp"
#include "state.hpp"

namespace multiphi {

using Requests = std::vector<int>;  // of every element: the state that it requests, or no_request
using Flags = std::vector<char>;    // of every element

// A change of state, or the impulse on a contact that stays closed in an impact ("shared"): these precede the change
// of the event that they belong to.
struct Change {
    int element = 0;
    int entered = 0;        // state entered; of a shared impulse `shared`
    int left = 0;           // state left
    double impulse = 0.0;   // [N s], 0 without an impact
    static constexpr int shared = -1;

    bool is_shared() const { return entered == shared; }
};

struct Instant {
    double time = 0.0;
    State reached;                 // the state right before the instant
    State trial;                   // the state decided so far, at the end the state right after it
    Requests asked;                // all requests at the instant
    Flags refused_before;          // elements that were refused at this instant before
    Flags treated;                 // elements that have been decided at it
    Flags freed;                   // closed rigid contacts whose reaction has fallen to zero at it
    Flags begins_last_bounce;      // rigid contacts whose last bounce begins
    std::vector<Change> changes;
    int first_change = 0;          // of the decision: earlier ones are impacts at the start
    Loss loss;                     // energies lost so far
    Loss transition_loss;          // of the present answer to a request, before it is accepted
    int transitions = 0;           // entered levels
    bool is_mapped_again = false;  // more than one transition has made the trial state
    bool velocities_changed = false;  // by an impact
    bool decided_together = false; // friction at rest has been decided (sentence 12)
};

}  // namespace multiphi
