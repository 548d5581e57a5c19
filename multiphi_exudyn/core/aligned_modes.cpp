#include "aligned_modes.hpp"

#include <algorithm>
#include <cmath>

#include "orthonormal.hpp"

namespace multiphi {

namespace {

constexpr double equal = 1e-11;    // of omega^2: nearer ones are equal up to the round-off of matrices and eigenvalues
constexpr double near = 1e-6;      // of omega^2: round-off mixes nearer modes by more than 1e-10, they are kept together
constexpr double moves = 1e-5;     // of the largest value of a row: of smaller values, round-off could choose a sign
constexpr double rotated = 1e-14;  // of a coordinate's amplitude in a cluster: a smaller value after a rotation is round-off

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

// The first row with a value (k,), else the one of the largest value.
Index first_row(const Vector& values, const Eigen::Ref<const Vector>& sizes) {
    Index largest = 0;
    double most = -1.0;
    for (Index i = 0; i < values.size(); ++i) {
        if (values[i] > moves * sizes[i]) return i;
        const double share = sizes[i] > 0.0 ? values[i] / sizes[i] : 0.0;
        if (share > most) {
            most = share;
            largest = i;
        }
    }
    return largest;
}

// A rotation (d, d) of d modes, columns, after which each has its own first row; values: (k, d) of all rows.
Matrix alignment(const Matrix& values, const Eigen::Ref<const Vector>& sizes) {
    const Index d = values.cols();
    Matrix rotation = Matrix::Identity(d, d);
    for (Index j = 0; j + 1 < d; ++j) {
        const Matrix turned = values * rotation.rightCols(d - j);
        const Index row = first_row(turned.rowwise().norm(), sizes);
        const double length = turned.row(row).norm();
        Vector reflector = turned.row(row).transpose() / (length > 0.0 ? length : 1.0);  // its mode comes first
        reflector[0] += std::copysign(1.0, reflector[0]);
        const Vector along = rotation.rightCols(d - j) * reflector;
        rotation.rightCols(d - j) -= 2.0 / reflector.squaredNorm() * along * reflector.transpose();
    }
    return rotation;
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

std::optional<int> cluster_end(const Vector& squares, int count) {
    for (Index end = count; end < squares.size(); ++end) {
        if (squares[end] - squares[end - 1] > near * std::abs(squares[end])) return static_cast<int>(end);
    }
    return std::nullopt;
}

Vector signs(const Eigen::Ref<const Matrix>& modes, const Eigen::Ref<const Matrix>& rows, const Eigen::Ref<const Vector>& sizes) {
    Vector result(modes.rows());
    for (Index j = 0; j < modes.rows(); ++j) {
        result[j] = sign_of_mode(modes.row(j).data(), static_cast<int>(modes.cols()), rows, sizes);
    }
    return result;
}

void align_clusters(Eigen::Ref<Vector> squares, Eigen::Ref<Matrix> modes, const Eigen::Ref<const Matrix>& rows,
                    const Eigen::Ref<const Vector>& sizes) {
    for (const auto& [first, end] : clusters(squares)) {
        const Index d = end - first;
        const Matrix cluster = modes.middleRows(first, d);
        Matrix values(rows.rows() + modes.cols(), d);
        values << rows * cluster.transpose(), cluster.transpose();
        const Matrix rotation = alignment(values, sizes);
        const Eigen::Array<double, 1, Eigen::Dynamic> lengths = cluster.colwise().norm().array();
        squares.segment(first, d).setConstant(squares.segment(first, d).mean());
        for (Index j = 0; j < d; ++j) {
            const auto mode = (rotation.col(j).transpose() * cluster).array().eval();
            modes.row(first + j) = (mode.abs() <= rotated * lengths).select(0.0, mode).matrix();
        }
    }
}

}  // namespace multiphi
