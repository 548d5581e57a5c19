#include "particular_solutions.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "exponentials.hpp"

namespace multiphi {

namespace {

constexpr double last_term = 1e-18;   // of a Taylor series: smaller terms are left out
constexpr double nearest_far = 0.5;   // |s - mu| T from which the finite polynomial is taken for a constant p,
constexpr double per_degree = 0.5;    // and more for each degree of p: it loses D! / (|s - mu| T)^D by cancellation
constexpr double outweighed = 10.0;   // times the motion: a finite polynomial up to this size costs one digit of it

// The number of Taylor coefficients up to round-off; reach: |distance| T.
int taylor_terms(int degree, double reach, int order) {
    double term = 1.0;
    int count = 0;
    while (term > last_term && term < std::numeric_limits<double>::infinity()) {
        ++count;
        term *= reach / count;
    }
    return degree + 1 + order + count;
}

// 1 / z, without overflow or underflow of |z|^2. size: |z|.
Complex inverse_of(Complex z, double size) { return {z.real() / size / size, -z.imag() / size / size}; }

void reserve(std::vector<Complex>& w, int count) {
    if (static_cast<int>(w.size()) < count) w.resize(count);
}

}  // namespace

bool is_far(double size, int degree, double unit) { return size * unit >= nearest_far + per_degree * degree; }

int first_order(Complex distance, const Complex* p, int degree, double unit, double motion, std::vector<Complex>& w) {
    const double size = modulus(distance);
    const bool far = is_far(size, degree, unit);
    if (far || size * motion > 0.0) {
        reserve(w, degree + 1);
        const Complex inverse = inverse_of(distance, size);
        Complex coefficient = 0.0;
        double total = 0.0;
        for (int k = degree; k >= 0; --k) {
            coefficient = ((k + 1) / unit * coefficient - p[k]) * inverse;
            w[k] = coefficient;
            total += std::abs(coefficient.real()) + std::abs(coefficient.imag());
        }
        if (far || total <= outweighed * motion) return degree + 1;
    }
    const int count = taylor_terms(degree, size * unit, 1);
    reserve(w, count);
    w[0] = 0.0;
    for (int k = 0; k + 1 < count; ++k) {
        const Complex force = k <= degree ? p[k] : 0.0;
        w[k + 1] = (distance * w[k] + force) * (unit / (k + 1));
    }
    return count;
}

int second_order(double square, double delta, Complex mu, const Complex* p, int degree, double unit,
                 std::vector<Complex>& w) {
    const Complex slope = 2.0 * (delta + mu), value = square + 2.0 * delta * mu + mu * mu;
    const double size = modulus(value), distance = std::sqrt(size);
    if (is_far(distance, degree + 1, unit)) {
        reserve(w, degree + 1);
        const Complex inverse = inverse_of(value, size);
        Complex first = 0.0, second = 0.0;  // derivatives of w
        for (int k = degree; k >= 0; --k) {
            const Complex above = (k + 1) / unit * first;
            w[k] = (p[k] - slope * above - (k + 1) / unit * second) * inverse;
            first = w[k];
            second = above;
        }
        return degree + 1;
    }
    const int count = taylor_terms(degree, std::max(distance, modulus(slope)) * unit, 2);
    reserve(w, count);
    w[0] = w[1] = 0.0;
    for (int k = 0; k + 2 < count; ++k) {
        const Complex force = k <= degree ? p[k] : 0.0;
        const Complex restoring = slope * w[k + 1] * ((k + 1) / unit) + value * w[k];
        w[k + 2] = (force - restoring) * (unit * unit / ((k + 1.0) * (k + 2)));
    }
    return count;
}

}  // namespace multiphi
