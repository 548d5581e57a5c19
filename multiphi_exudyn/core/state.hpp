// State: where the model is at an instant, in the coordinates of its level, and what every guard waits for.
//
// Beside xi and xi' it knows the sizes below which they are round-off: the scales of the motion, |eta'| / omega and
// omega |eta|, and the terms of the transition that has made it. Decisions compare with these (sentence 9).
#pragma once

#include <vector>

#include "excitation.hpp"
#include "level.hpp"
#include "linear_algebra.hpp"
#include "transition.hpp"

namespace multiphi {

enum class Phase : unsigned char {
    armed,       // its signal is not negative
    recovering,  // negative by truncation, and rising
    refused,     // it may not make the change that it requests
    held_back,   // refused, and would repeat its request at the same instant without end; or held open (law/exchanges.hpp)
    landing,     // of a rigid contact on its last bounce: at its end it stays closed
};

struct State {
    const Level* level = nullptr;
    Vector displacement, velocity;                    // xi, xi' (n,)
    Vector displacement_scale, velocity_scale;        // of the motion that has led here (n,)
    Vector mapped_displacement, mapped_velocity;      // sizes of the terms of the transition that has made it (n,)
    std::vector<Phase> phases;                        // of every guard of the level
    bool all_armed = true;

    // Gives the vectors the size of a level.
    void enter(const Level& entered);
};

// Sets the scales of a state to |eta'| / omega and omega |eta|, and for channels to the sizes of w and w'.
void measure(State& state, const Inputs& inputs);

// Raises the scales of a state to those of an earlier one of the same level and instant.
void keep_scales(State& state, const State& earlier);

// Sets modal velocities to zero that are round-off of omega |eta|: a mode at its turning point would strike with them.
void clear_turning_velocities(State& state);

// xi'' (n,), and the sizes of its terms with omega |eta'|, which the velocities lead to.
void accelerate(const State& state, const Inputs& inputs, Vector& result);
void acceleration_sizes(const State& state, const Inputs& inputs, Vector& result);

// The state with the displacement of `displaced` and the velocity of `moving`, states of the same instant, in a level.
// Memory for the sizes of its terms is kept.
class Mover {
  public:
    void move(const State& displaced, const Transition& by_displacement, const State& moving,
              const Transition& by_velocity, const Inputs& inputs, State& result);
    const Vector& displacement_sizes() const { return displacement_sizes_; }  // of the last move (n,)

  private:
    Vector displacement_sizes_, velocity_sizes_;
};

double gap(const State& state, int link);

// ---------------------------------------------------------------------- signs of signals (sentence 9)

// Sign of a signal, 0 if it is round-off of its terms and of the scales; `further`: the size of further terms.
int signal_sign(const State& state, const Signal& signal, double further = 0.0);
// Sign of its time derivative.
int rate_sign(const State& state, const Signal& signal, const Inputs& inputs);
// Size of its terms, or of its rate's, in the transition that has made the state.
double mapped_size(const State& state, const Signal& signal);
double mapped_rate_size(const State& state, const Signal& signal);
// Its part due to held channels, which only a transition changes, and the size of that part's terms.
double held_part(const State& state, const Signal& signal);
double held_size(const State& state, const Signal& signal);

}  // namespace multiphi
