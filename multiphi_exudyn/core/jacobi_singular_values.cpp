#include "jacobi_singular_values.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include <Eigen/QR>

#include "failure.hpp"
#include "orthonormal.hpp"

namespace multiphi {

namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon();
constexpr int most_sweeps = 40;     // four to eight are typical
constexpr double vanished = 0.1;    // of its square: a row that rotations have shortened to less is measured anew

// Rows that rotations make orthogonal.
class RotatedRows {
  public:
    explicit RotatedRows(Matrix rows) : rows_(std::move(rows)), n_(static_cast<int>(rows_.cols())), squares_(rows_.rows()) {}

    void orthogonalise() {
        const int r = static_cast<int>(rows_.rows());
        const double negligible = epsilon * std::sqrt(static_cast<double>(n_));
        for (int sweep = 0; sweep < most_sweeps; ++sweep) {
            bool is_orthogonal = true;
            for (int i = 0; i < r; ++i) measure(i);
            for (int i = 0; i + 1 < r; ++i) {
                for (int j = i + 1; j < r; ++j) {
                    const double shared = scalar_product(row(i), row(j), n_);
                    if (std::abs(shared) <= negligible * std::sqrt(squares_[i]) * std::sqrt(squares_[j])) continue;
                    rotate(i, j, shared);
                    is_orthogonal = false;
                }
            }
            if (is_orthogonal) return;
        }
        throw NumericalFailure(Cause::level_not_finite);
    }

    const Matrix& rows() const { return rows_; }

  private:
    double* row(int i) { return rows_.row(i).data(); }
    void measure(int i) { squares_[i] = scalar_product(row(i), row(i), n_); }

    // Rotates two rows so that their product vanishes.
    void rotate(int i, int j, double shared) {
        const double zeta = (squares_[j] - squares_[i]) / (2.0 * shared);
        const double tangent = std::copysign(1.0, zeta) / (std::abs(zeta) + std::hypot(1.0, zeta));
        const double cosine = 1.0 / std::hypot(1.0, tangent), sine = cosine * tangent;
        double *one = row(i), *other = row(j);
        for (int k = 0; k < n_; ++k) {
            const double first = one[k], second = other[k];
            one[k] = cosine * first - sine * second;
            other[k] = sine * first + cosine * second;
        }
        const double square = squares_[i] - tangent * shared, second_square = squares_[j] + tangent * shared;
        const bool is_clear = square > vanished * squares_[i] && second_square > vanished * squares_[j];
        squares_[i] = square;
        squares_[j] = second_square;
        if (!is_clear) {
            measure(i);
            measure(j);
        }
    }

    Matrix rows_;
    int n_;
    Vector squares_;
};

// Replaces rows of length zero by unit vectors that are orthogonal to all others, which have length one.
void complete(Matrix& vectors, const std::vector<bool>& is_missing) {
    const int n = static_cast<int>(vectors.cols());
    OrthonormalBasis basis;
    basis.clear(n);
    for (Index i = 0; i < vectors.rows(); ++i) {
        if (!is_missing[static_cast<std::size_t>(i)]) basis.add_direction(vectors.row(i).data(), 1.0);
    }
    Vector unit(n);
    int next = 0;
    for (Index i = 0; i < vectors.rows(); ++i) {
        if (!is_missing[static_cast<std::size_t>(i)]) continue;
        do {
            unit.setZero();
            unit[next++] = 1.0;
        } while (!basis.add_direction(unit.data(), 1.0) && next < n);
        vectors.row(i) = Eigen::Map<const Vector>(basis[basis.size() - 1], n).transpose();
    }
}

}  // namespace

JacobiSingularValues jacobi_singular_values(const Matrix& matrix) {
    const Index k = matrix.rows(), n = matrix.cols();
    JacobiSingularValues result{Vector::Zero(n), Matrix::Identity(n, n)};
    if (n == 0) return result;
    const double largest = matrix.cwiseAbs().maxCoeff();
    if (!std::isfinite(largest)) throw NumericalFailure(Cause::level_not_finite);
    if (largest == 0.0) return result;
    const double scale = std::ldexp(1.0, -std::ilogb(largest));  // squares of rows shall not overflow
    const Vector lengths = matrix.cwiseAbs().rowwise().maxCoeff();
    std::vector<Index> order(static_cast<std::size_t>(k));
    std::iota(order.begin(), order.end(), Index{0});
    std::stable_sort(order.begin(), order.end(), [&](Index i, Index j) { return lengths[i] > lengths[j]; });
    const Eigen::MatrixXd sorted = scale * matrix(order, Eigen::all);
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> factors(sorted);
    RotatedRows rows(factors.matrixQR().topRows(n).triangularView<Eigen::Upper>());
    rows.orthogonalise();
    const Matrix& orthogonal = rows.rows();
    const Vector found = orthogonal.rowwise().norm();
    std::vector<Index> rising(static_cast<std::size_t>(n));
    std::iota(rising.begin(), rising.end(), Index{0});
    std::stable_sort(rising.begin(), rising.end(), [&](Index i, Index j) { return found[i] < found[j]; });
    const auto& places = factors.colsPermutation().indices();
    std::vector<bool> is_missing(static_cast<std::size_t>(n));
    for (Index i = 0; i < n; ++i) {
        const Index from = rising[static_cast<std::size_t>(i)];
        result.values[i] = found[from] / scale;
        is_missing[static_cast<std::size_t>(i)] = !(found[from] > std::numeric_limits<double>::min());
        for (Index j = 0; j < n; ++j) result.vectors(i, places[j]) = orthogonal(from, j) / found[from];
    }
    if (is_missing[0]) complete(result.vectors, is_missing);
    return result;
}

}  // namespace multiphi
