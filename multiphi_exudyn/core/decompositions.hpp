// Decompositions of matrices without symmetry, behind plain functions: all of Eigen that takes long to compile.
#pragma once

#include <vector>

#include "linear_algebra.hpp"

namespace multiphi {

// A V = V diag(lambda): rates (n,) and vectors of length one, columns (n, n). Real ones have no imaginary parts; others
// come in pairs, the one above the real axis first.
struct Eigenpairs {
    ComplexVector rates;
    ComplexMatrix vectors;
};

// Eigenpairs of a real matrix (n, n), balanced before. Throws NumericalFailure where the iteration does not converge.
Eigenpairs eigenpairs(const Matrix& system);

// A = Q T Q^H, T upper triangular with the eigenvalues on its diagonal, Q unitary.
struct Schur {
    ComplexMatrix triangle;
    ComplexMatrix basis;

    // Moves the eigenvalues at these places, in rising order, to the first places, by unitary steps.
    void bring_forward(const std::vector<int>& places);
};

// The Schur form of a real matrix (n, n). Throws NumericalFailure where the iteration does not converge.
Schur complex_schur(const Matrix& system);

// The largest singular value over the smallest one, infinite where a matrix (n, n) is singular or not finite.
double condition(const Matrix& matrix);
double condition(const ComplexMatrix& matrix);

// A = Q R of a matrix (m, n), m >= n: Q (m, n) with orthonormal columns, R (n, n) upper triangular.
struct OrthogonalTriangular {
    Matrix basis, triangle;
};
OrthogonalTriangular orthogonal_triangular(const Matrix& matrix);
// Orthonormal columns (m, m - n) that are orthogonal to the columns of a matrix (m, n) of full rank.
Matrix null_space(const Matrix& matrix);

// Left singular vectors, columns (m, k), and singular values (k,) of a matrix (m, n), descending, k = min(m, n).
struct LeftSingularVectors {
    Matrix vectors;
    Vector values;
};
LeftSingularVectors left_singular_vectors(const Matrix& matrix);

// Solves A x = b for one matrix A (n, n) and many b: by elimination, or where A is singular by the shortest x of least
// squares.
class LinearSolver {
  public:
    LinearSolver() = default;
    explicit LinearSolver(Matrix matrix);
    Vector solution(const Vector& b) const;

  private:
    Matrix matrix_, triangles_;
    std::vector<int> rows_;  // order in which elimination takes them
    bool is_singular_ = false;
};

// x of least squares of A x = b, A (m, n): the shortest one.
Vector least_squares(const Matrix& a, const Vector& b);
double determinant(const Matrix& matrix);

// X of A X = B, and A^-1, for A (n, n).
Matrix solve(const Matrix& a, const Matrix& b);
ComplexMatrix solve(const ComplexMatrix& a, const ComplexMatrix& b);
ComplexMatrix inverse(const ComplexMatrix& a);
Matrix inverse(const Matrix& a);

}  // namespace multiphi
