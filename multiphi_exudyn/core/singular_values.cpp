#include "singular_values.hpp"

#include <limits>

#include <Eigen/LU>
#include <Eigen/SVD>

namespace multiphi {

namespace {

constexpr double singular = std::numeric_limits<double>::epsilon();  // of the largest singular value, and for each row

}  // namespace

SingularValues singular_values(const Matrix& a) {
    if (a.size() == 0) {
        return {Matrix::Identity(a.rows(), a.rows()), Vector(0), Matrix::Identity(a.cols(), a.cols())};
    }
    const Eigen::BDCSVD<Eigen::MatrixXd> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
    return {svd.matrixU(), svd.singularValues(), svd.matrixV()};
}

Vector solve_or_least(const Matrix& a, const Vector& b) {
    const Eigen::PartialPivLU<Eigen::MatrixXd> factors(a);
    if (factors.rcond() > singular) return factors.solve(b);
    const SingularValues parts = singular_values(a);
    const double largest = parts.values.size() > 0 ? parts.values[0] : 0.0;
    const Index rank = (parts.values.array() > singular * static_cast<double>(a.rows()) * largest).count();
    const Vector shares = (parts.left.leftCols(rank).transpose() * b).cwiseQuotient(parts.values.head(rank));
    return parts.right.leftCols(rank) * shares;
}

}  // namespace multiphi
