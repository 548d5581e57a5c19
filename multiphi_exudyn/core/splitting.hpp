// Splitting: steps of a baseline that runs are compared with (reference_models/splitting.py): free motion exact, penalty
// forces of contacts by kicks before and after it (Strang).
//
//     z' -= h/2 sum_i h_i k_i min(0, g_i);  z, z' moved on by h, exactly;  the kick again,   g_i = h_i.z + gap_i
#pragma once

#include "linear_algebra.hpp"

namespace multiphi {

// Fills a record (steps + 1, 2 r) of (z, z') from its first row on. flow (4, r): z and z' after a step from z and z'. rows
// (c, r), laws (c, 2): gap [m] and stiffness [N/m].
void split_steps(double step, const Matrix& flow, const Matrix& rows, const Matrix& laws, Eigen::Ref<Matrix> record);

}  // namespace multiphi
