// Motion parts: independent parts of a linear motion z' = A z, its eigenvalues and clusters of them.
//
//     z = Re V y,   y' = T y,   y(0) = W z(0)
//
// T is diagonal where A has a complete set of eigenvectors, independent by more than round-off. Where some of them
// (nearly) coincide, at a double root with one eigenvector, those of a cluster span one part, with an upper triangular
// T (Schur): its motion has powers of time,
//
//     exp(T t) = exp(lambda t) sum_k N^k t^k / k!,   N = T - lambda I,   lambda the cluster's mean
//
// A conjugate pair is kept once, with its weight doubled. A rate that is round-off of its terms W A V is zero: so it is
// where friction cancels damping.
// Source: G. H. Golub, C. F. Van Loan, Matrix Computations, 4th ed. 2013, ch. 7.6 and 9.1.
#pragma once

#include <vector>

#include "linear_algebra.hpp"
#include "response.hpp"

namespace multiphi {

struct MotionParts {
    ComplexVector rates;        // lambda (k,)
    ComplexMatrix vectors;      // V (s, k)
    ComplexMatrix inverse;      // W (k, s)
    ComplexMatrix mixing;       // T (k, k)
    std::vector<Range> groups;  // the components of every part

    int size() const { return static_cast<int>(rates.size()); }

    // N^d / d! (m, m) of a part, d = 0, 1, ...
    std::vector<ComplexMatrix> powers(const Range& part) const;
};

// The parts of z' = A z, A (s, s) finite. Throws NumericalFailure where round-off makes them indistinct.
MotionParts motion_parts(const Matrix& system);

}  // namespace multiphi
