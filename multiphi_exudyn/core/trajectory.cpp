#include "trajectory.hpp"

#include <algorithm>

namespace multiphi {

int Trajectory::level_number(const Level& level) {
    const auto by_address = [&](const std::pair<const Level*, int>& known) { return known.first == &level; };
    const auto known = std::find_if(numbers_.rbegin(), numbers_.rend(), by_address);
    if (known != numbers_.rend()) return known->second;
    const auto by_key = std::find(keys.begin(), keys.end(), level.key());  // a level may have been made twice
    const int number = static_cast<int>(by_key - keys.begin());
    if (by_key == keys.end()) {
        keys.push_back(level.key());
        widths.push_back(level.width());
        guards.push_back(static_cast<int>(level.guards().size()));
    }
    numbers_.emplace_back(&level, number);
    return number;
}

std::size_t Trajectory::bytes() const {
    return instants.size() * sizeof(double) + segments.size() * sizeof(Segment) + coordinates.size() * sizeof(double) +
           phases.size() * sizeof(Phase) + events.size() * sizeof(Event) + left_out.size() * sizeof(int);
}

}  // namespace multiphi
