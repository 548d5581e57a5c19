#include "light_damping.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace multiphi {

namespace {

constexpr double light = 0.2;        // of omega, and of a distance of two modes: larger damping is not light
constexpr double symmetric = 1e-13;  // of the largest damping: round-off of a symmetric matrix
constexpr double last = 2e-16;       // of a mode: predicted next step, from the slowest reduction so far
constexpr int most_steps = 30;       // of the iteration; three to ten are typical

constexpr double infinity = std::numeric_limits<double>::infinity();

class PairIteration {
  public:
    PairIteration(const Vector& squares, const Matrix& damping)
        : r_(squares.size()), squares_(squares), damping_(damping), coupling_(damping),
          vectors_(Matrix::Zero(2 * r_, r_)), products_(Matrix::Zero(2 * r_, r_)), rates_(ComplexVector::Zero(r_)) {
        coupling_.diagonal().setZero();
    }

    // Whether the vectors of all pairs have converged.
    bool converges() {
        if (!is_light()) return false;
        vectors_.topRows(r_).setIdentity();
        products_.topRows(r_) = coupling_;
        double previous = 1.0, reduction = 0.0;
        for (int step = 0; step < most_steps; ++step) {
            const double change = improve();
            if (!(change < infinity)) return false;
            reduction = std::max(reduction, change / previous);
            previous = change;
            products_.noalias() = vectors_ * coupling_;
            if (change * reduction <= last) return true;
        }
        return false;
    }

    ModalResponse response() {
        ModalResponse result;
        const int r = static_cast<int>(r_);
        result.modes = r;
        result.squares = squares_;
        result.half_damping = damping_.diagonal() / 2;
        result.from_displacement.resize(r, r);
        result.from_velocity.resize(r, r);
        result.from_force = ComplexMatrix::Zero(r, r);
        result.shapes.resize(r, r);
        for (Index i = 0; i < r_; ++i) write_pair(i, result);
        result.basis = Exponentials(std::vector<int>(r, 0), std::vector<Complex>(rates_.begin(), rates_.end()), 1.0);
        result.uncoupled.assign(r, false);
        result.poles.assign(r, true);
        result.reached.assign(r, Range{0, r});
        return result;
    }

  private:
    // Whether damping is symmetric and light for all modes and their distances.
    bool is_light() const {
        double largest = 0.0;
        for (Index i = 0; i < r_; ++i) {
            largest = std::max(largest, damping_(i, i));
            if (!(std::abs(damping_(i, i)) < light * std::sqrt(std::max(squares_[i], 0.0)))) return false;
        }
        for (Index j = 0; j < r_; ++j) {
            double row_sum = 0.0;
            for (Index k = 0; k < r_; ++k) {
                if (!(std::abs(coupling_(j, k) - coupling_(k, j)) <= symmetric * largest)) return false;
                row_sum += std::abs(coupling_(j, k));
            }
            for (Index i = 0; i < r_; ++i) {
                if (i != j && !(row_sum * std::sqrt(squares_[i]) <= light * std::abs(squares_[j] - squares_[i]))) {
                    return false;
                }
            }
        }
        return true;
    }

    Complex vector(Index i, Index j) const { return {vectors_(i, j), vectors_(r_ + i, j)}; }
    Complex product(Index i, Index j) const { return {products_(i, j), products_(r_ + i, j)}; }

    // Sets lambda of pair i from G v, the root above the real axis; whether there is one.
    bool set_rate(Index i) {
        const Complex half = 0.5 * (damping_(i, i) + product(i, i)), difference = squares_[i] - half * half;
        if (!(difference.real() > 0.0)) return false;
        const double root = std::sqrt(0.5 * (modulus(difference) + difference.real()));
        rates_[i] = Complex(-0.5 * difference.imag() / root - half.real(), root - half.imag());
        return true;
    }

    // Updates v of all pairs from G v; the largest change of a part of v, infinite where one is not finite.
    double improve() {
        double largest = 0.0;
        for (Index i = 0; i < r_; ++i) {
            if (!set_rate(i)) return infinity;
            const Complex rate = rates_[i], diagonal = damping_(i, i) + product(i, i);
            for (Index j = 0; j < r_; ++j) {
                if (j == i) continue;
                const Complex denominator = squares_[j] - squares_[i] + rate * (damping_(j, j) - diagonal);
                const Complex inverse = std::conj(denominator) * (1.0 / std::norm(denominator));
                const Complex component = -rate * product(i, j) * inverse;
                const Complex step = component - vector(i, j);
                const double change = std::max(std::abs(step.real()), std::abs(step.imag()));
                if (!(change < infinity) || !(std::abs(step.imag()) < infinity)) return infinity;
                largest = std::max(largest, change);
                vectors_(i, j) = component.real();
                vectors_(r_ + i, j) = component.imag();
            }
        }
        return largest;
    }

    // Sets lambda, V^T, A and B of pair i.
    void write_pair(Index i, ModalResponse& result) {
        set_rate(i);
        const Complex rate = rates_[i];
        Complex theta = 0.0;
        for (Index j = 0; j < r_; ++j) {
            const Complex v = vector(i, j);
            theta += v * ((2.0 * rate + damping_(j, j)) * v + product(i, j));
            result.shapes(i, j) = v;
        }
        const Complex weight = std::conj(theta) * (2.0 / std::norm(theta));
        const Complex inverse_rate = std::conj(rate) * (-1.0 / std::norm(rate));
        for (Index j = 0; j < r_; ++j) {
            result.from_velocity(i, j) = weight * result.shapes(i, j);
            result.from_displacement(i, j) = squares_[j] * (inverse_rate * result.from_velocity(i, j));
        }
    }

    Index r_;
    const Vector& squares_;
    const Matrix& damping_;
    Matrix coupling_;            // G (r, r)
    Matrix vectors_, products_;  // v and G v, a row for each pair: first their real, then their imaginary parts (2r, r)
    ComplexVector rates_;        // lambda (r,)
};

}  // namespace

std::optional<ModalResponse> lightly_damped_response(const Vector& squares, const Matrix& damping) {
    PairIteration iteration(squares, damping);
    if (!iteration.converges()) return std::nullopt;
    return iteration.response();
}

}  // namespace multiphi
