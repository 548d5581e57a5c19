// Transition: a state expressed in the coordinates of the next level (eq. 38.6).
//
//     xi_m = T xi_l + c,   xi'_m = T' xi'_l,   T = Psi_m^T Psi_l,   c = Psi_m^T (y_l - y_m)       (without channels)
//
// The paper's "Phi_m^-1" is the M-projection. Channels stay what they are; where a link begins to hold a displacement
// it becomes the stretch of the state before.
#pragma once

#include <cstddef>
#include <optional>

#include "level.hpp"
#include "linear_algebra.hpp"

namespace multiphi {

struct Transition {
    const Level* source = nullptr;
    const Level* target = nullptr;
    Matrix matrix;                // T (n_m, n_l)
    Matrix velocity_matrix;       // T'
    Vector offset;                // c (n_m,)
    std::optional<Matrix> terms;  // (n_m, n_l + 1) sums of the absolute terms of T and c, where links may hold
    Matrix start_sizes;           // from the base: terms due to channels and to the equilibrium (r, q + 1); else empty

    Transition(const Level& source, const Level& target);  // the source may be the base

    std::size_t bytes() const;
};

// The guard by which an element would come back from the state of a level to another one.
const GuardForm& return_guard(const ElementState& entered, int left);

// The signal of an element after a transition, as a function of the state before it.
Signal entered_signal(const Transition& transition, int element);

}  // namespace multiphi
