#include "orthonormal.hpp"

#include <algorithm>
#include <cmath>

#include "round_off.hpp"

namespace multiphi {

namespace {

// Of a direction's square: with a smaller part in the span of others it is independent of them, whatever round-off
// says.
constexpr double almost = 0.99;

}  // namespace

double scalar_product(const double* a, const double* b, int m) {
    double sum_0 = 0.0, sum_1 = 0.0, sum_2 = 0.0, sum_3 = 0.0;
    int i = 0;
    for (; i + 3 < m; i += 4) {
        sum_0 += a[i] * b[i];
        sum_1 += a[i + 1] * b[i + 1];
        sum_2 += a[i + 2] * b[i + 2];
        sum_3 += a[i + 3] * b[i + 3];
    }
    for (; i < m; ++i) sum_0 += a[i] * b[i];
    return (sum_0 + sum_1) + (sum_2 + sum_3);
}

double norm(const double* vector, int m) { return std::sqrt(scalar_product(vector, vector, m)); }

double absolute_product(const double* a, const double* b, int m) {
    double sum_0 = 0.0, sum_1 = 0.0, sum_2 = 0.0, sum_3 = 0.0;
    int i = 0;
    for (; i + 3 < m; i += 4) {
        sum_0 += std::abs(a[i] * b[i]);
        sum_1 += std::abs(a[i + 1] * b[i + 1]);
        sum_2 += std::abs(a[i + 2] * b[i + 2]);
        sum_3 += std::abs(a[i + 3] * b[i + 3]);
    }
    for (; i < m; ++i) sum_0 += std::abs(a[i] * b[i]);
    return (sum_0 + sum_1) + (sum_2 + sum_3);
}

void add_multiple(double* vector, double factor, const double* other, int m) {
    for (int i = 0; i < m; ++i) vector[i] += factor * other[i];
}

void remove_direction(const double* direction, double* vectors, int m, int count) {
    const double square = scalar_product(direction, direction, m);
    if (!(square > 0.0)) return;
    for (int k = 0; k < count; ++k) {
        double* vector = vectors + static_cast<std::ptrdiff_t>(k) * m;
        const double share = scalar_product(direction, vector, m) / square;
        add_multiple(vector, -share, direction, m);
    }
}

double largest_product_error(const double* vectors, int m, int r) {
    double largest = 0.0;
    for (int i = 0; i < r; ++i) {
        for (int j = 0; j <= i; ++j) {
            const double* own = vectors + static_cast<std::ptrdiff_t>(i) * m;
            const double* other = vectors + static_cast<std::ptrdiff_t>(j) * m;
            const double error = std::abs(scalar_product(own, other, m) - (i == j ? 1.0 : 0.0));
            if (!(error <= largest)) largest = error;
        }
    }
    return largest;
}

void OrthonormalBasis::clear(int m) {
    m_ = m;
    size_ = 0;
    vectors_.resize(0, m);
}

bool OrthonormalBasis::orthogonalise(const double* direction, double length) {
    if (vectors_.count() == size_) vectors_.add();
    double* added = vectors_[size_];
    for (int i = 0; i < m_; ++i) added[i] = length > 0.0 ? direction[i] / length : 0.0;
    for (int pass = 0; pass < 2; ++pass) {
        for (int p = 0; p < size_; ++p) {
            const double share = scalar_product(vectors_[p], added, m_);
            add_multiple(added, -share, vectors_[p], m_);
        }
    }
    const double remainder = norm(added, m_);
    if (!(remainder > round_off::independent)) return false;
    for (int i = 0; i < m_; ++i) added[i] *= 1.0 / remainder;
    return true;
}

bool OrthonormalBasis::add_direction(const double* direction, double length) {
    const bool is_independent = orthogonalise(direction, length);
    if (is_independent) ++size_;
    return is_independent;
}

bool OrthonormalBasis::holds(const double* direction, double length) {
    double square = 0.0;
    for (int p = 0; p < size_ && length > 0.0; ++p) {
        const double share = scalar_product(vectors_[p], direction, m_) / length;
        square += share * share;
    }
    return square > almost && !orthogonalise(direction, length);
}

void OrthonormalBasis::remove_from(double* vectors, int count) const {
    for (int k = 0; k < count; ++k) {
        double* vector = vectors + static_cast<std::ptrdiff_t>(k) * m_;
        for (int p = 0; p < size_; ++p) {
            const double share = scalar_product(vectors_[p], vector, m_);
            add_multiple(vector, -share, vectors_[p], m_);
        }
    }
}

bool span(const Eigen::Ref<const Matrix>& directions, const Eigen::Ref<const Vector>& lengths,
          const std::vector<int>& held, OrthonormalBasis& basis) {
    basis.clear(static_cast<int>(directions.cols()));
    for (const int link : held) {
        if (!basis.add_direction(directions.row(link).data(), lengths[link])) return false;
    }
    return true;
}

std::vector<bool> following(const Eigen::Ref<const Matrix>& directions, const Eigen::Ref<const Vector>& lengths,
                            OrthonormalBasis& basis) {
    std::vector<bool> flags(static_cast<std::size_t>(directions.rows()));
    for (Index link = 0; link < directions.rows(); ++link) {
        const double* direction = directions.row(link).data();
        const double length = lengths[link];
        flags[static_cast<std::size_t>(link)] = length == 0.0 || basis.holds(direction, length);
    }
    return flags;
}

Matrix without(const Eigen::Ref<const Matrix>& directions, const Eigen::Ref<const Matrix>& vectors) {
    const int m = static_cast<int>(vectors.cols());
    OrthonormalBasis basis;
    basis.clear(m);
    for (Index k = 0; k < directions.rows(); ++k) {
        const double* direction = directions.row(k).data();
        basis.add_direction(direction, norm(direction, m));
    }
    Matrix result = vectors;
    basis.remove_from(result.data(), static_cast<int>(result.rows()));
    return result;
}

}  // namespace multiphi
