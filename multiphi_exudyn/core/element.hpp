// Element: a contact, friction or force law, linear in each of its states; and the links by which it acts.
//
//     q = h.x + gap - w,   lambda = -k q - c q' along +h;   rigid: q = 0, lambda its reaction
//
// An element has links, some of which act in each of its states; the element itself is its first link. A state lasts as
// long as for each of its guards the signal, summed over the links,
//
//     s = gap q + velocity q' + force lambda + constant
//
// is not negative. When it falls through zero the element requests the guard's target. The stick position w of a link is
// *held*: only a change of state moves it.
#pragma once

#include <optional>
#include <vector>

#include "linear_algebra.hpp"

namespace multiphi {

enum class Kind {
    compliant,  // contact with a spring
    rigid,      // contact whose reaction is what it needs to be
    viscous,    // contact with a spring and a damper
    bounded,    // contact with a spring and a damper whose force is at most that of the spring
    sliding,    // friction that is no part of a contact, or a force law with a held link
};

// What happens to a guard whose signal is negative after changes of other elements, or by truncation.
enum class Rule {
    may_recover,     // the state stays while the signal rises, and the guard waits until it has risen to zero
    never_recovers,  // the guard does not wait for the signal to rise
    always_taken,    // nor does it ask whether the new state is admissible: the state changes at once
    taken_once,      // it waits while the signal rises; else the state changes at once, but not back to the last state
    taken_falling,   // it waits while the signal rises; else the state changes at once
};

// Whether a request by this rule is granted whatever the level entered says of it (sentences 3 and 8).
inline bool is_unconditional(Rule rule) {
    return rule == Rule::always_taken || rule == Rule::taken_once || rule == Rule::taken_falling;
}

// States of a contact, and of friction beside its stick state.
inline constexpr int open_state = 0, closed_state = 1;
inline constexpr int slip_forward = 1, slip_backward = 2, idle = 3;  // after the stick state of a friction element

inline constexpr int no_request = -1;  // in place of a requested state

// Share of a link in the signal of a guard: coefficients of its q, q' and lambda.
struct Share {
    int link = 0;  // index among all links
    double gap = 0.0, velocity = 0.0, force = 0.0;
};

// States that a guard requests instead of its target if a link's q' is positive (forward) or negative (backward).
struct TargetByVelocity {
    int link = 0, forward = 0, backward = 0;
};

// Guard of a state, as the element states it; a level turns it into a signal of its own coordinates (level.hpp).
struct GuardForm {
    int target = 0;
    Rule rule = Rule::may_recover;
    double constant = 0.0;
    std::vector<Share> shares;
    std::optional<TargetByVelocity> by_velocity;
};

// Friction whose force is a multiple of the force of a link: the stretch of its spring follows it while it slips.
struct FrictionRatio {
    int link = 0;
    double ratio = 0.0;
};

struct ElementState {
    std::vector<GuardForm> guards;
    std::vector<int> links;  // that act, indices among all links
    double force = 0.0;      // constant force along +h of the first link [N]
    double stretch = 0.0;    // of the held link, for the state in which it acts next [m]
    std::optional<FrictionRatio> ratio;
};

// Knots of a force law: the link of the first one, and how many lie above and below its segment 0. None if link is 0.
struct Knots {
    int first_link = 0, above = 0, below = 0;
};

// Held link of a friction element: the state in which it sticks, -1 for none, its spring [N/m], 0 for a rigid one, and
// the part of the spring's energy that is lost when it begins to slip.
struct Stick {
    int state = -1, link = 0;
    double spring = 0.0, drop = 0.0;
};

struct Element {
    Kind kind = Kind::compliant;
    std::vector<int> links;
    std::vector<ElementState> states;
    double stiffness = 0.0;    // of the first link [N/m], 0 if rigid
    double restitution = 0.0;  // of a rigid contact
    // Limits of friction without a tangential spring, sliding and static: forces [N], or ratios to the normal force at a
    // contact that is not rigid; else 0.
    double limit = 0.0, static_limit = 0.0;
    // Coefficients of friction of a rigid contact, sliding and static; else 0.
    double friction = 0.0, static_friction = 0.0;
    Knots knots;
    Stick stick;

    bool is_rigid() const { return kind == Kind::rigid; }
    bool has_stick() const { return stick.state >= 0; }
};

}  // namespace multiphi
