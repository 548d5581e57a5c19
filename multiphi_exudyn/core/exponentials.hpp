// Exponentials: the functions of time in which every motion of a level is a finite sum (eq. 38.3).
//
//     phi_j(t) = (t / T)^d_j exp(lambda_j t),   f(t) = Re sum_j c_j phi_j(t)
//
// d_j are powers of time, lambda_j rates [1/s], T a unit of time [s]. A term with d_j > 0 follows the one with d_j - 1 at
// the same rate. Numbers that overflow become infinite; what depends on them is not finite, and nothing throws.
#pragma once

#include <cmath>
#include <vector>

#include "linear_algebra.hpp"

namespace multiphi {

// exp of a real number, infinite on overflow.
double exponential(double exponent);

// |z|, without overflow or underflow of its square. Between the limits squares are neither denormal nor infinite.
inline double modulus(const Complex& z) {
    constexpr double smallest_square = 1e-280, largest_square = 1e280;
    const double square = z.real() * z.real() + z.imag() * z.imag();
    if (smallest_square < square && square < largest_square) return std::sqrt(square);
    return std::hypot(z.real(), z.imag());
}

struct Exponentials {
    std::vector<int> powers;       // d (p,)
    std::vector<Complex> rates;    // lambda (p,) [1/s]
    double unit = 1.0;             // T [s]
    double fastest = 0.0;          // the largest |lambda| [1/s]
    double growth = 0.0;           // the largest Re lambda above zero [1/s]
    bool pure = true;              // every power is zero
    bool eternal = true;           // and nothing grows

    Exponentials() = default;
    Exponentials(std::vector<int> powers, std::vector<Complex> rates, double unit);

    int size() const { return static_cast<int>(rates.size()); }

    // Sets fastest, growth, pure and eternal after powers, rates or the unit have been changed.
    void describe();

    // (t / T)^d_j exp(lambda_j u) (p,): phi at t where u = t, else phi without the factors exp(lambda_j (t - u)).
    void evaluate(double u, double t, Complex* result) const;
    void evaluate(double t, Complex* result) const { evaluate(t, t, result); }

    // Coefficients (p,) of the time derivative of Re sum_j c_j phi_j; `result` may be `c`.
    void differentiate(const Complex* c, Complex* result) const;
};

}  // namespace multiphi
