// Coupled modes: the free motion of modes that damping or friction couple.
//
//     eta'' + D eta' + S eta = p,   S = diag(omega^2) + coupling by friction, D and S not symmetric
//
// The motions are those of z' = A z, z = (|omega| eta_e, eta') with the elastic modes e, with the unit of a velocity
// (motion_parts.hpp). Zero-frequency modes are added. Damped ones have no other forces: eta_f' is part of z, and eta_f
// its integral. Undamped ones, a, are driven by the others and drive none,
//
//     eta_a'' = R y + p_a,   eta_a = R T^-2 y + a + b t + p_a t^2 / 2
//
// p is constant on zero-frequency modes, and zero on the others. With B the columns of W for eta', the parts tend to
// y = -T^-1 B p, with which the damped zero-frequency modes drift.
//
// Of a part y' = lambda y that is slow compared with the duration of a motion, the integrals y / lambda and
// y / lambda^2 would be large terms with small differences: q' = y, and u' = q that drives undamped modes, are motions
// of their own, in powers of time. So are those of a part with lambda = 0, where friction cancels the damping of a
// zero-frequency mode.
#pragma once

#include "motion_terms.hpp"

namespace multiphi {

// The motion of modes with omega^2 (r,), stiffness S and damping D (r, r), for at most `duration` [s].
MotionTerms coupled_motion(const Vector& squares, const Matrix& stiffness, const Matrix& damping, double duration);

}  // namespace multiphi
