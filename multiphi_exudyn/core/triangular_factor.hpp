// Triangular factor: R of a QR decomposition, which has the lengths of all sums of columns.
//
//     |A z| = |R z|   for every z
#pragma once

#include "linear_algebra.hpp"

namespace multiphi {

// R (n, n), upper triangular, of A (m, n); its last rows are zero where m < n.
Matrix triangular_factor(const Matrix& a);

}  // namespace multiphi
