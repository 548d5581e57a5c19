// Power forms: the powers in a level, linear and quadratic in xi, xi' and xi'', for the works in the energy ledger.
//
//     damping   xi'.D xi'
//     varying   sum_k  w_k a_k.xi' + w_k' (b_k.xi + c_k.xi' + d_k.xi'' + e_k)
//     friction  f.xi' + sum_e T_e (s_e.xi'),   T_e = t_e.xi + t_e'.xi' + constant
//
// Varying loads work on the motion, moving stops and supports by the forces that they take. Friction is taken from the
// motion by constant forces f, and by forces T_e that follow the force of a link: T_e is a limit, s_e.xi' the slip.
#pragma once

#include <vector>

#include "linear_algebra.hpp"

namespace multiphi {

class Level;

struct LinkFriction {
    Vector displacement, velocity;  // t_e, t_e' (n,)
    double constant = 0.0;
    Vector slip_velocity;           // s_e (n,), on which T_e works without its constant part
    Vector slip;                    // (n,) on whose change its constant part works
};

struct PowerForms {
    Matrix damping;                                                 // D (n, n), symmetric
    Matrix on_value, on_displacement, on_velocity, on_acceleration; // a, b, c, d (q, n)
    Vector constant;                                                // e (q,)
    Vector friction;                                                // f (n,), empty where no friction acts
    std::vector<LinkFriction> link_friction;
};

PowerForms power_forms(const Level& level);

}  // namespace multiphi
