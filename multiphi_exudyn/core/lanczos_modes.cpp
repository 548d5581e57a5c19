#include <cmath>
#include <random>
#include <utility>

#include "decompositions.hpp"
#include "level_modes.hpp"
#include "orthonormal.hpp"
#include "symmetric_eigenpairs.hpp"

namespace multiphi {

namespace {

constexpr double apart = 1e-6;       // least relative distance of two compliances between which modes can be counted
constexpr double converged = 1e-14;  // of its compliance: residual of an eigenvector that is found
constexpr int first_steps = 3;       // for each mode, after which the vectors found so far are looked at
constexpr double longer = 1.5;       // times as many steps before they are looked at again

// The compliance A of a level, times a vector.
class LevelCompliance {
  public:
    LevelCompliance(const Base& base, const Matrix& directions, const Vector& inverse)
        : compliance_(base.squares.cwiseInverse()), deflections_(directions * compliance_.asDiagonal()) {
        Matrix flexibility = directions * deflections_.transpose();
        flexibility.diagonal() += inverse;
        solver_ = LinearSolver(std::move(flexibility));
    }

    Vector operator()(const Vector& load) const {
        return compliance_.cwiseProduct(load) - deflections_.transpose() * solver_.solution(deflections_ * load);
    }

  private:
    Vector compliance_;
    Matrix deflections_;
    LinearSolver solver_;
};

// A vector that has a part in every mode: a symmetric one would miss modes. The same on every machine.
Vector start_vector(int m) {
    std::mt19937_64 random(0);
    Vector result(m);
    for (double& value : result) value = std::ldexp(static_cast<double>(random() >> 11), -52) - 1.0;
    return result.normalized();
}

// The number of modes of a level below sigma.
Index modes_below(const Base& base, const Matrix& directions, const Vector& inverse, double sigma) {
    const Vector shifted = base.squares.array() - sigma;
    Matrix counted = directions * shifted.cwiseInverse().asDiagonal() * directions.transpose();
    counted.diagonal() += inverse;
    const Index shifted_up = (symmetric_eigenpairs(counted).values.array() <= 0.0).count();
    return (shifted.array() < 0.0).count() - shifted_up;
}

// Eigenpairs of A on a space that grows by one vector a step, orthonormal rows q_k: A q_k = b_k-1 q_k-1 + a_k q_k + b_k q_k+1.
class Lanczos {
  public:
    Lanczos(const LevelCompliance& compliance, int m)
        : compliance_(compliance), vectors_(m, m), diagonal_(m), beside_(m) {
        vectors_.row(0) = start_vector(m);
    }

    // Grows the space to so many vectors; false where it is closed before.
    bool grow(int count) {
        for (; size_ < count; ++size_) {
            const int m = static_cast<int>(vectors_.cols());
            Vector next = compliance_(vectors_.row(size_).transpose());
            diagonal_[size_] = next.dot(vectors_.row(size_));
            for (int pass = 0; pass < 2; ++pass) {
                const Vector shares = vectors_.topRows(size_ + 1) * next;
                next -= vectors_.topRows(size_ + 1).transpose() * shares;
            }
            beside_[size_] = next.norm();
            if (size_ + 1 == m) return false;
            if (!(beside_[size_] > 0.0)) return false;
            vectors_.row(size_ + 1) = next / beside_[size_];
        }
        return true;
    }

    // The largest `count` eigenvalues, and their vectors, if all of these have converged.
    std::optional<std::pair<Vector, Matrix>> largest(int count) const {
        Matrix projected = Matrix::Zero(size_, size_);
        for (int k = 0; k < size_; ++k) {
            projected(k, k) = diagonal_[k];
            if (k + 1 < size_) projected(k, k + 1) = projected(k + 1, k) = beside_[k];
        }
        const Symmetric found = symmetric_eigenpairs(projected);
        const Matrix wanted = found.vectors.rightCols(count);
        const Vector residuals = beside_[size_ - 1] * wanted.row(size_ - 1).cwiseAbs();
        if (!(residuals.array() <= converged * found.values.tail(count).array()).all()) return std::nullopt;
        return std::make_pair(Vector(found.values.tail(count)), Matrix(wanted.transpose() * vectors_.topRows(size_)));
    }

    int size() const { return size_; }

  private:
    const LevelCompliance& compliance_;
    Matrix vectors_;
    Vector diagonal_, beside_;
    int size_ = 0;
};

}  // namespace

std::optional<Matrix> lanczos_modes(const Base& base, const Matrix& directions, const Vector& stiffness, int count) {
    const int m = base.modes();
    // Directions of one length in the energy of the structure: pivots do not depend on units.
    const Vector lengths = (directions * base.periods.asDiagonal()).rowwise().norm();
    const Matrix scaled = lengths.cwiseInverse().asDiagonal() * directions;
    const Vector inverse = (stiffness.array() * lengths.array().square()).inverse();
    const LevelCompliance compliance(base, scaled, inverse);
    Lanczos space(compliance, m);
    for (int steps = first_steps * (count + 1); steps < m; steps = static_cast<int>(longer * steps)) {
        const bool may_grow = space.grow(steps);
        const auto found = space.size() > count ? space.largest(count + 1) : std::nullopt;
        if (found) {
            const double next = found->first[0], last = found->first[1];  // of the highest mode and the one above it
            if (!(next < (1.0 - apart) * last)) return std::nullopt;
            if (modes_below(base, scaled, inverse, 2.0 / (next + last)) != count) return std::nullopt;
            return Matrix(found->second.bottomRows(count));
        }
        if (!may_grow) return std::nullopt;
    }
    return std::nullopt;
}

}  // namespace multiphi
