// Failure: why a run ends before its time. Inside the core it is an exception; outside it is the status of a trajectory.
#pragma once

#include <array>
#include <exception>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace multiphi {

enum class Cause {
    not_finite,         // the motion grows beyond all numbers
    search_too_long,    // the next event lies too many samples away
    chatter,            // more events than modes and loads can follow
    not_admissible,     // no set of closed contacts is admissible at the instant
    squeezed,           // stops move against each other and leave no way out
    unsettled,          // round-off, or high friction, decides which contacts push
    mixed_restitution,  // contacts struck together have different restitutions
    gaining_energy,     // an impact with friction and different restitutions would create energy
    record_full,        // the record of the run would fill the memory
    // of a level
    level_not_finite,     // its stiffness or damping is not finite
    indistinct_modes,     // two coupled modes are critically damped alike, to round-off
    cancelled_stiffness,  // friction cancels the stiffness of a mode beside a zero-frequency mode
};

inline bool is_of_a_level(Cause cause) {
    return cause == Cause::level_not_finite || cause == Cause::indistinct_modes || cause == Cause::cancelled_stiffness;
}

class NumericalFailure : public std::exception {
  public:
    explicit NumericalFailure(Cause cause, std::vector<int> elements = {}, std::array<double, 3> details = {})
        : cause_(cause), elements_(std::move(elements)), details_(details) {}

    const char* what() const noexcept override { return "numerical failure"; }
    Cause cause() const noexcept { return cause_; }
    const std::vector<int>& elements() const noexcept { return elements_; }      // that are involved
    const std::array<double, 3>& details() const noexcept { return details_; }  // numbers of the message

  private:
    Cause cause_;
    std::vector<int> elements_;
    std::array<double, 3> details_;
};

// Why a level cannot be built, in a sentence.
class LevelFailure : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

// What a user has to give otherwise, in a sentence.
class ArgumentError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

// A number in a message, with six digits.
std::string text_of(double number);

}  // namespace multiphi
