#include "triangular_factor.hpp"

#include <algorithm>

#include <Eigen/QR>

namespace multiphi {

Matrix triangular_factor(const Matrix& a) {
    Matrix result = Matrix::Zero(a.cols(), a.cols());
    const Index rows = std::min(a.rows(), a.cols());
    if (rows == 0) return result;
    const Eigen::HouseholderQR<Eigen::MatrixXd> decomposition{Eigen::MatrixXd(a)};
    result.topRows(rows) = decomposition.matrixQR().topRows(rows).triangularView<Eigen::Upper>();
    return result;
}

}  // namespace multiphi
