#include "symmetric_eigenpairs.hpp"

#include <Eigen/Eigenvalues>

#include "failure.hpp"

namespace multiphi {

Symmetric symmetric_eigenpairs(const Matrix& matrix) {
    const Index n = matrix.rows();
    if (n == 0) return {Vector(0), Matrix(0, 0)};
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(matrix);
    if (solver.info() != Eigen::Success) throw NumericalFailure(Cause::indistinct_modes);
    // One step towards orthonormal vectors: states that go through them often keep their length.
    const Eigen::MatrixXd& vectors = solver.eigenvectors();
    const Eigen::MatrixXd product = vectors.transpose() * vectors;
    return {solver.eigenvalues(), vectors - vectors * ((product - Eigen::MatrixXd::Identity(n, n)) / 2)};
}

Matrix pseudo_inverse(const Matrix& matrix, double least) {
    const Vector scales = matrix.diagonal().cwiseSqrt().cwiseInverse();
    const Symmetric scaled = symmetric_eigenpairs(scales.asDiagonal() * matrix * scales.asDiagonal());
    Vector inverses = scaled.values;
    for (double& value : inverses) value = value > least ? 1.0 / value : 0.0;
    const Matrix vectors = scales.asDiagonal() * scaled.vectors;
    return vectors * inverses.asDiagonal() * vectors.transpose();
}

}  // namespace multiphi
