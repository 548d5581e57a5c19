// Energies of a state, and what an event takes of them (the ledger's entries).
#pragma once

#include "state.hpp"

namespace multiphi {

// Energies [J] that left the model at an event. stop_work: put in by impulses of moving stops, which is no loss.
struct Loss {
    double impact = 0.0, truncation_kinetic = 0.0, truncation_strain = 0.0;
    double stop_work = 0.0, damping = 0.0, friction = 0.0;

    Loss& operator+=(const Loss& other);
};

double kinetic_energy(const State& state);    // |Psi eta' + Y w'|^2 / 2
double potential_energy(const State& state);  // strain energy less the potential of static loads
double load_work(const State& state);         // potential of the varying loads at their present values, (b w).y
double total_energy(const State& state);      // sum of the three
double strain_energy(const State& state);     // no difference of large energies

// Adds the losses between two states of one instant, less the energy `collided` that an impact took. key_before: the
// states of the elements before, which at a start are not those of the level.
//
// A viscous contact that opens inside its stop loses the energy of its spring, and one that closes there regains it. A
// bounded damper loses or regains that of the springs which cease or begin to act inside the stop. A spring that begins
// to slip loses the difference of its energies before and after the drop from its static limit.
void add_losses(const State& before, const Key& key_before, const State& after, double collided, Loss& loss);

}  // namespace multiphi
