// Light damping: oscillating modes that it couples; components of the other modes by iteration.
//
//     (lambda^2 + lambda D + diag(omega^2)) v = 0,   D = diag(d) + G symmetric,   v_i = 1 in pair i
//
// From v = e_i, every row j gives its component, and row i the rate:
//
//     v_j = -lambda (G v)_j / (omega_j^2 - omega_i^2 + lambda (d_j - d_i - (G v)_i)),   j not i
//     lambda^2 + lambda (d_i + (G v)_i) + omega_i^2 = 0
//
// all pairs at once. The error falls by the ratio of damping to the distance of two modes in every step. As D is
// symmetric, the same vectors give the motion from an initial state (F. Tisseur, K. Meerbergen, The quadratic
// eigenvalue problem, SIAM Rev. 43 (2001) 235, sec. 3):
//
//     eta(t) = Re sum_i v_i c_i exp(lambda_i t),   c_i = 2 v_i . (eta'(0) - omega^2 eta(0) / lambda_i) / theta_i
//     theta_i = v_i . (2 lambda_i + D) v_i
#pragma once

#include <optional>

#include "response.hpp"

namespace multiphi {

// The response where D is symmetric and light for all modes and their distances, and the iteration converges.
std::optional<ModalResponse> lightly_damped_response(const Vector& squares, const Matrix& damping);

}  // namespace multiphi
