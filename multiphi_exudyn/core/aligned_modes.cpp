#include "aligned_modes.hpp"

#include <algorithm>
#include <cmath>

#include "orthonormal.hpp"

namespace multiphi {

namespace {

constexpr double equal = 1e-11;  // of omega^2: nearer ones are equal up to the round-off of matrices and eigenvalues

double sign_of_mode(const double* mode, int m, const Eigen::Ref<const Matrix>& rows,
                    const Eigen::Ref<const Vector>& sizes) {
    const int k = static_cast<int>(rows.rows());
    double largest = -1.0, sign = 1.0;
    for (int i = 0; i < k + m; ++i) {
        const double value = i < k ? scalar_product(rows.row(i).data(), mode, m) : mode[i - k];
        const double share = sizes[i] > 0.0 ? std::abs(value) / sizes[i] : 0.0;
        if (share > largest) {
            largest = share;
            sign = value < 0.0 ? -1.0 : 1.0;
        }
        if (share > moves) break;
    }
    return sign;
}

}  // namespace

std::vector<std::pair<int, int>> clusters(const Vector& squares) {
    std::vector<std::pair<int, int>> result;
    const int r = static_cast<int>(squares.size());
    for (int first = 0, end = 1; first < r; first = end++) {
        while (end < r && squares[end] - squares[end - 1] <=
                              equal * std::max(std::abs(squares[end]), std::abs(squares[end - 1]))) {
            ++end;
        }
        if (end - first > 1) result.emplace_back(first, end);
    }
    return result;
}

Vector signs(const Matrix& modes, const Eigen::Ref<const Matrix>& rows, const Eigen::Ref<const Vector>& sizes) {
    Vector result(modes.rows());
    for (Index j = 0; j < modes.rows(); ++j) {
        result[j] = sign_of_mode(modes.row(j).data(), static_cast<int>(modes.cols()), rows, sizes);
    }
    return result;
}

}  // namespace multiphi
