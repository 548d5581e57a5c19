// Singular values: all of a matrix, each as accurate as its own size, by a one-sided Jacobi method.
//
//     A P = Q R  (rows sorted and columns pivoted by size),   J R = diag(sigma) U^T,   A = Q J^T diag(sigma) (P U)^T
//
// A fine beam spans omega_max / omega_1 = 1e5 and more. An eigensolver applied to the stiffness loses the lowest omega^2
// to round-off of the largest; here rotations J make the rows of R orthogonal, each to round-off of its own length.
// Source: J. Demmel et al., Computing the singular value decomposition with high relative accuracy, Linear Algebra Appl.
// 299 (1999) 21; Z. Drmac, K. Veselic, SIAM J. Matrix Anal. Appl. 29 (2008) 1322.
#pragma once

#include "linear_algebra.hpp"

namespace multiphi {

struct JacobiSingularValues {
    Vector values;   // (n,) ascending
    Matrix vectors;  // right singular vectors (n, n), one a row
};

// Of a matrix (k, n), k >= n. Throws NumericalFailure where rotations do not end, as of numbers that are not finite.
JacobiSingularValues jacobi_singular_values(const Matrix& matrix);

}  // namespace multiphi
