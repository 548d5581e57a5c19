// Channels of a level: its response to varying loads and moving stops, as prescribed coordinates (38.4 to 38.6).
//
//     x = Psi eta + y_inf + R w,   R w = (K_l^-1 - Psi omega^-2 Psi^T) (b w + k h s w)  +  Y w
//
// xi = (eta, w), w (q,) the channels, b and s their patterns and stops (excitation.hpp). The first part is the
// quasi-static response of the modes left out: their inertia is neglected, their strain and the work of the load on them
// are not. Y holds the motion due to rigid stops, the static shapes of eq. (38.5) with x_k(t); it has inertia:
//
//     eta'' + D eta' + omega^2 eta = P w + Q w',   P = Psi^T (b + k h s),   on w' as a channel of its own
//                                                  P = Psi^T (c h s - C Y),   Q = -Psi^T Y
//
// In xi every gap and contact force is again linear.
#pragma once

#include "excitation.hpp"
#include "linear_algebra.hpp"
#include "sliding.hpp"

namespace multiphi {

struct Channels {
    Matrix force, force_rate;                    // P, Q (r, q)
    Matrix carried;                              // Y (m, q)
    Matrix shapes;                               // R (m, q), and
    Matrix sizes;                                //   the sizes of the terms that R is a sum of
    Matrix contact_force, contact_force_rate;    // forces (k, q) of the closed links at w = 1 and w' = 1

    // With the friction that sliding contacts add.
    Channels(const MovingLevel& level, const Excitation& excitation);

  private:
    void add_loads(const ModalLevel& level, const Excitation& excitation);
    void add_stops(const MovingLevel& level, const Excitation& excitation);
    void add_rates(const ModalLevel& level, const Excitation& excitation);
    void add_friction(const Sliding& sliding, int prescribed);
};

// Gaps (l, q) of all links at w = 1, and their velocities in impacts at w' = 1.
struct ChannelGaps {
    Matrix gaps, velocities;

    ChannelGaps(const ModalLevel& level, const Excitation& excitation, const Channels& channels);
};

}  // namespace multiphi
