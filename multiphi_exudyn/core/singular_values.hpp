// Singular values, and solutions where a matrix may be singular.
#pragma once

#include "linear_algebra.hpp"

namespace multiphi {

// A = U diag(values) V^T (m, n): values (min(m, n),) descending, U (m, m), V (n, n).
struct SingularValues {
    Matrix left;
    Vector values;
    Matrix right;
};
SingularValues singular_values(const Matrix& a);

// x of A x = b, A (n, n); where A is singular to round-off, that of least squares and least length.
Vector solve_or_least(const Matrix& a, const Vector& b);

}  // namespace multiphi
