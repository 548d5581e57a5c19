#include "residual_boundary.hpp"

#include <utility>
#include <vector>

#include "failure.hpp"
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

ResidualBoundary::ResidualBoundary(std::shared_ptr<const MovingLevel> given)
    : host(std::move(given)), links(host->modal.base().residual) {
    const ModalLevel& level = host->modal;
    const Base& base = level.base();
    const Index c = static_cast<Index>(links.size());
    shapes.resize(c, base.modes());
    forces_of_host.resize(c, static_cast<Index>(level.links().size()));
    compliances.resize(c);
    for (Index i = 0; i < c; ++i) {
        const Deflection beside = level.beside_modes(base.directions.row(links[static_cast<std::size_t>(i)]));
        shapes.row(i) = beside.configuration;
        forces_of_host.row(i) = beside.forces;
        compliances[i] = 1.0 / base.stiffnesses[links[static_cast<std::size_t>(i)]];
    }
    const Matrix directions = base.directions(links, Eigen::all);
    gaps = base.directions * shapes.transpose();
    flexibility = gaps(links, Eigen::all);
    for (Index i = 0; i < c; ++i) {
        const double whole = directions.row(i).transpose().cwiseProduct(base.periods).squaredNorm();
        if (compliances[i] != 0.0 || flexibility(i, i) > round_off::independent * whole) continue;
        throw ArgumentError("boundary of '" + base.names[static_cast<std::size_t>(links[static_cast<std::size_t>(i)])] +
                            "': got 'residual' for a rigid contact where all modes are kept, need 'own' or fewer modes");
    }
    flexibility = Matrix(flexibility + flexibility.transpose()) / 2.0;
}

}  // namespace multiphi
