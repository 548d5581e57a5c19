// Eigenpairs of symmetric matrices.
#pragma once

#include "linear_algebra.hpp"

namespace multiphi {

// S V = V diag(values): values (n,) ascending and orthonormal vectors, columns (n, n).
struct Symmetric {
    Vector values;
    Matrix vectors;
};

// Throws NumericalFailure where the iteration does not converge.
Symmetric symmetric_eigenpairs(const Matrix& matrix);

// The inverse of a symmetric, not indefinite matrix (n, n) with a positive diagonal, on what it resists: directions whose
// share of the diagonal is `least` or smaller are left out.
Matrix pseudo_inverse(const Matrix& matrix, double least);

}  // namespace multiphi
