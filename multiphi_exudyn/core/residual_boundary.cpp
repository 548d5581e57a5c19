#include "residual_boundary.hpp"

#include <vector>

#include "round_off.hpp"
#include "symmetric_eigenpairs.hpp"

namespace multiphi {

namespace {

// Columns (r, r): the zero-frequency modes that the contacts do not resist, `free` of them, then all other motions.
Matrix sorted_motions(const Vector& squares, const Matrix& gaps, Index& free) {
    const Index r = squares.size();
    std::vector<Index> neutral, others;
    for (Index i = 0; i < r; ++i) (squares[i] == 0.0 ? neutral : others).push_back(i);
    const Index count = static_cast<Index>(neutral.size());
    Matrix motions = Matrix::Zero(r, r);
    free = 0;
    if (count > 0) {
        const Matrix seen = gaps(Eigen::all, neutral);
        const Symmetric resisted = symmetric_eigenpairs(seen.transpose() * seen);  // ascending
        const double least = round_off::independent * gaps.rowwise().norm().maxCoeff();
        for (Index j = 0; j < count; ++j) {
            if (resisted.values[j] <= least * least) ++free;
            for (Index i = 0; i < count; ++i) motions(neutral[static_cast<std::size_t>(i)], j) = resisted.vectors(i, j);
        }
    }
    for (Index j = 0; j < r - count; ++j) motions(others[static_cast<std::size_t>(j)], count + j) = 1.0;
    return motions;
}

}  // namespace

ResidualModes residual_modes(const Vector& squares, const Matrix& gaps, const Matrix& flexibility,
                             const Vector& compliances) {
    Matrix compliance = (flexibility + flexibility.transpose()) / 2;
    compliance.diagonal() += compliances;
    const Matrix stiffness = pseudo_inverse(compliance, round_off::independent);  // A
    Index free = 0;
    const Matrix motions = sorted_motions(squares, gaps, free);
    const Index r = squares.size(), rest = r - free;
    const Matrix bending = motions.rightCols(rest), seen = gaps * bending;
    const Symmetric modes = symmetric_eigenpairs(bending.transpose() * squares.asDiagonal() * bending +
                                                 seen.transpose() * stiffness * seen);
    ResidualModes result{Vector::Zero(r), Matrix(r, r), {}};
    result.squares.tail(rest) = modes.values;
    result.rotation << motions.leftCols(free), bending * modes.vectors;
    result.forces = -(stiffness * (gaps * result.rotation));
    return result;
}

}  // namespace multiphi
