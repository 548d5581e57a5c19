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

// X of A X = B, and A^-1, for A (n, n).
ComplexMatrix solve(const ComplexMatrix& a, const ComplexMatrix& b);
ComplexMatrix inverse(const ComplexMatrix& a);
Matrix inverse(const Matrix& a);

}  // namespace multiphi
