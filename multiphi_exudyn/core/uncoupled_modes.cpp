#include "uncoupled_modes.hpp"

#include <algorithm>
#include <cmath>

#include "round_off.hpp"

namespace multiphi {

namespace {

constexpr double diagonal = 1e-13;        // of sqrt(D_ii D_jj): off-diagonal damping below it is round-off
constexpr double nearly_critical = 1e-2;  // |zeta^2 - 1|^(1/2) below which a Taylor polynomial is more accurate
constexpr double last_power = 1e-17;      // of the first: smaller powers of time, in slow velocities, are left out

// delta^2 - omega^2, without cancellation of squares.
double discriminant(double delta, double omega) { return (delta - omega) * (delta + omega); }

bool oscillates(double square, double delta) {
    const double omega = std::sqrt(std::abs(square)), difference = discriminant(delta, omega);
    return square > 0.0 && difference < 0.0 && std::sqrt(std::abs(difference)) > nearly_critical * omega;
}

// The terms of one mode, each with its weights of eta, eta' and p.
class ModeTerms {
  public:
    ModeTerms(MotionTerms& motion, int mode) : motion_(motion), mode_(mode) {}

    void add(Complex rate, int power, Complex of_displacement, Complex of_velocity, Complex of_force = 0.0) {
        MotionTerm term(rate, power, static_cast<int>(motion_.uncoupled.size()));
        term.from_displacement[mode_] = of_displacement;
        term.from_velocity[mode_] = of_velocity;
        term.from_force[mode_] = of_force;
        term.shape[mode_] = 1.0;
        motion_.terms.push_back(std::move(term));
    }

  private:
    MotionTerms& motion_;
    int mode_;
};

void add_oscillation(ModeTerms& terms, double square, double delta) {
    const double root = std::sqrt(std::abs(discriminant(delta, std::sqrt(square))));
    terms.add(Complex(-delta, root), 0, Complex(1.0, -delta / root), Complex(0.0, -1.0 / root));
}

// Two real rates, of which each moves by its share of the start.
void add_pair(ModeTerms& terms, double one, double other) {
    const double difference = one - other;
    terms.add(one, 0, -other / difference, 1.0 / difference);
    terms.add(other, 0, one / difference, -1.0 / difference);
}

// omega^2 < 0, delta >= 0: a growing and a decaying rate, the smaller from their product.
void add_growing(ModeTerms& terms, double square, double delta) {
    const double decaying = -(delta + std::sqrt(delta * delta - square));
    add_pair(terms, square / decaying, decaying);
}

// eta'' + 2 delta eta' = p; a slow one is p - 2 delta eta'(0) with decay, integrated twice.
void add_free(ModeTerms& terms, double delta, double duration) {
    const double rate = 2.0 * delta;
    if (delta == 0.0 || is_slow(rate, duration)) {
        terms.add(0.0, 0, 1.0, 0.0);
        terms.add(0.0, 1, 0.0, 1.0);
        if (delta == 0.0) {
            terms.add(0.0, 2, 0.0, 0.0, 0.5);
            return;
        }
        const std::vector<Complex> weights = slow_powers(-rate, duration);
        for (std::size_t n = 0; n < weights.size(); ++n) {
            terms.add(0.0, static_cast<int>(n) + 2, 0.0, -rate * weights[n], weights[n]);
        }
        return;
    }
    terms.add(0.0, 0, 1.0, 1.0 / rate, -1.0 / (rate * rate));
    terms.add(0.0, 1, 0.0, 0.0, 1.0 / rate);
    terms.add(-rate, 0, 0.0, -1.0 / rate, 1.0 / (rate * rate));
}

// Overdamped, or nearly critical: cosh and sinh(s t) / s of small s t, to t^5.
void add_decaying(ModeTerms& terms, double square, double delta) {
    const double omega = std::sqrt(square), s = discriminant(delta, omega), root = std::sqrt(std::abs(s));
    if (root <= nearly_critical * omega) {
        const double even[] = {1.0, 0.0, s / 2, 0.0, s * s / 24, 0.0}, odd[] = {0.0, 1.0, 0.0, s / 6, 0.0, s * s / 120};
        for (int d = 0; d < 6; ++d) terms.add(-delta, d, even[d] + delta * odd[d], odd[d]);
        return;
    }
    const double fast = -(delta + root);
    add_pair(terms, square / fast, fast);
}

}  // namespace

bool is_diagonal(const Matrix& damping) {
    const Index r = damping.rows();
    double largest = 0.0;
    for (Index i = 0; i < r; ++i) largest = std::max(largest, std::abs(damping(i, i)));
    for (Index i = 0; i < r; ++i) {
        for (Index j = 0; j < r; ++j) {
            const double own = std::sqrt(std::abs(damping(i, i) * damping(j, j)));
            const double scale = std::max(own, largest * diagonal);
            if (i != j && !(std::abs(damping(i, j)) <= diagonal * scale)) return false;
        }
    }
    return true;
}

bool is_slow(Complex rate, double duration) { return modulus(rate) <= round_off::slow / duration; }

std::vector<Complex> slow_powers(Complex rate, double duration) {
    std::vector<Complex> weights{0.5};
    const double size = modulus(rate) * duration;
    double velocity = size / 2.0;  // of the next power, in units of the first
    while (velocity > last_power) {
        weights.push_back(weights.back() * rate / static_cast<double>(weights.size() + 2));
        velocity *= size / static_cast<double>(weights.size() + 1);
    }
    return weights;
}

MotionTerms uncoupled_motion(const Vector& squares, const Matrix& damping, double duration) {
    const int r = static_cast<int>(squares.size());
    MotionTerms motion(r);
    motion.uncoupled.assign(r, true);
    for (int k = 0; k < r; ++k) {
        ModeTerms terms(motion, k);
        const double delta = damping(k, k) / 2.0;
        if (oscillates(squares[k], delta)) add_oscillation(terms, squares[k], delta);
    }
    for (int k = 0; k < r; ++k) {
        ModeTerms terms(motion, k);
        const double square = squares[k], delta = damping(k, k) / 2.0;
        if (oscillates(square, delta)) continue;
        if (square == 0.0) {
            add_free(terms, delta, duration);
        } else if (square < 0.0) {
            add_growing(terms, square, delta);
        } else {
            add_decaying(terms, square, delta);
        }
    }
    return motion;
}

}  // namespace multiphi
