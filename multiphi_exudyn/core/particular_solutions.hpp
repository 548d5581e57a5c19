// Particular solutions of one equation of first or second order to a polynomial of time, in powers of t / T.
//
//     w' = (s - mu) w + p(t),   w'' + 2 (delta + mu) w' + (omega^2 + 2 delta mu + mu^2) w = p(t)
//
// of z = exp(mu t) w, for [0, T]. Far from the pole (|s - mu| T large) w is the finite polynomial
//
//     w_k = ((k + 1) w_k+1 / T - p_k) / (s - mu),   k = D, ..., 0
//
// and near to it, at resonance included, the Taylor series of the motion from rest, truncated at round-off:
//
//     w_k+1 = T ((s - mu) w_k + p_k) / (k + 1),   w_0 = 0
//
// Nothing grows beyond the load's own size, whatever the distance from a pole. Beside a free motion the finite
// polynomial is used nearer to the pole, as long as it is not much larger: its cancellation is then round-off of the
// motion.
#pragma once

#include <vector>

#include "linear_algebra.hpp"

namespace multiphi {

// Whether a pole is so far, for a polynomial of this degree, that the finite polynomial is not large. size: |s - mu|.
bool is_far(double size, int degree, double unit);

// Sets w (K + 1,) of first order for p (degree + 1,), and returns K + 1. distance: s - mu. motion: the size of the free
// motion of the pole. w grows where it is too short.
int first_order(Complex distance, const Complex* p, int degree, double unit, double motion, std::vector<Complex>& w);

// Sets w (K + 1,) of second order, for poles close together, and returns K + 1.
int second_order(double square, double delta, Complex mu, const Complex* p, int degree, double unit,
                 std::vector<Complex>& w);

}  // namespace multiphi
