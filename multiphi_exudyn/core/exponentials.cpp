#include "exponentials.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace multiphi {

namespace {

constexpr double largest_exponent = 709.0;  // exp of a larger number overflows

}  // namespace

double exponential(double exponent) {
    return exponent < largest_exponent ? std::exp(exponent) : std::numeric_limits<double>::infinity();
}

Exponentials::Exponentials(std::vector<int> given_powers, std::vector<Complex> given_rates, double given_unit)
    : powers(std::move(given_powers)), rates(std::move(given_rates)), unit(given_unit) {
    describe();
}

void Exponentials::describe() {
    fastest = growth = 0.0;
    pure = true;
    for (int j = 0; j < size(); ++j) {
        fastest = std::max(fastest, modulus(rates[j]));
        growth = std::max(growth, rates[j].real());
        if (powers[j] > 0) pure = false;
    }
    eternal = pure && growth == 0.0;
}

void Exponentials::evaluate(double u, double t, Complex* result) const {
    const double ratio = t / unit;
    for (int j = 0; j < size(); ++j) {
        if (powers[j] > 0) {
            result[j] = result[j - 1] * ratio;
        } else if (u == 0.0) {
            result[j] = 1.0;
        } else {
            const double size = exponential(rates[j].real() * u), angle = rates[j].imag() * u;
            result[j] = Complex(size * std::cos(angle), size * std::sin(angle));
        }
    }
}

void Exponentials::differentiate(const Complex* c, Complex* result) const {
    for (int j = 0; j < size(); ++j) {
        const Complex coefficient = c[j];
        result[j] = product(coefficient, rates[j]);
        if (powers[j] > 0) result[j - 1] += (powers[j] / unit) * coefficient;
    }
}

}  // namespace multiphi
