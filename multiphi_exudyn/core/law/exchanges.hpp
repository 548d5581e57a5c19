// Exchanges: rigid contacts that close again and again, faster than their modes can follow (sentence 6).
//
// A contact without restitution that closes more than `most_closings` times in a period of the fastest mode or load is held
// open for another such period.
#pragma once

#include <limits>
#include <vector>

namespace multiphi {

class Exchanges {
  public:
    static constexpr int most_closings = 3;  // in a period

    void begin(int contacts) { contacts_.assign(contacts, {}); }

    // Counts a closing at a time [s], in a level with a shortest period [s].
    void count(int contact, double time, double period) {
        Contact& its = contacts_[contact];
        if (time - its.since > period) its = {time, 0, its.held_until};
        if (++its.closings > most_closings) hold(contact, time + period);
    }
    void hold(int contact, double until) { contacts_[contact] = {-infinity, 0, until}; }

    bool is_held(int contact, double time) const { return time < contacts_[contact].held_until; }
    // Whether a contact has been held until an instant after `start`, at or before `time`.
    bool is_released(int contact, double start, double time) const {
        return start < contacts_[contact].held_until && contacts_[contact].held_until <= time;
    }
    // The first instant after a time at which a contact is released, infinite if none is held.
    double next_release(double time) const {
        double next = infinity;
        for (const Contact& contact : contacts_)
            if (time < contact.held_until && contact.held_until < next) next = contact.held_until;
        return next;
    }

  private:
    static constexpr double infinity = std::numeric_limits<double>::infinity();
    struct Contact {
        double since = -infinity;       // the first closing that is counted [s]
        int closings = 0;               // since then
        double held_until = -infinity;  // [s]
    };
    std::vector<Contact> contacts_;
};

}  // namespace multiphi
