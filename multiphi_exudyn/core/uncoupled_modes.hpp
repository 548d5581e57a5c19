// Uncoupled modes: each has a closed form of its own.
//
//     eta'' + 2 delta eta' + omega^2 eta = p
//
// Underdamped, overdamped, nearly critical by a Taylor polynomial, growing, or of zero frequency. A zero-frequency mode
// whose damping is slow compared with the duration of its motion has powers of time: exponentials would be large terms,
// of eta' / D and p / D^2, with small differences.
#pragma once

#include <vector>

#include "linear_algebra.hpp"
#include "motion_terms.hpp"

namespace multiphi {

// Whether the off-diagonal elements of damping (r, r) are round-off.
bool is_diagonal(const Matrix& damping);

// Whether a rate [1/s] is slow for motions of at most `duration` [s]; only zero is for an infinite one.
bool is_slow(Complex rate, double duration);

// w_n = rate^n / (n + 2)!, n = 0, 1, ...; exp(rate t) integrated twice is t^2 sum_n w_n t^n.
std::vector<Complex> slow_powers(Complex rate, double duration);

// The motion of modes with omega^2 (r,) and D (r, r) diagonal: first the modes that oscillate, then the others.
MotionTerms uncoupled_motion(const Vector& squares, const Matrix& damping, double duration);

}  // namespace multiphi
