#include "static_response.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "round_off.hpp"

namespace multiphi {

namespace {

constexpr double hardly_bends = 1e-8;  // of a direction's length, the root of round-off: no correction undoes less
constexpr int most_corrections = 8;    // each takes an error to its product with round-off times the softest compliance

// Orthonormal basis (rigid-body coordinates, c) of the rigid-body motions that closed directions resist.
Matrix resisted_motions(const Base& base, const ClosedDirections& directions) {
    const int rigid = base.rigid_body_modes;
    if (rigid == 0 || directions.resisting().empty()) return Matrix(rigid, 0);
    const Matrix resisting = directions.vectors()(directions.resisting(), Eigen::seqN(0, rigid));
    const LeftSingularVectors found = left_singular_vectors(resisting.transpose());
    const Index count = (found.values.array() > round_off::independent * directions.size()).count();
    return found.vectors.leftCols(count);
}

}  // namespace

Vector without_round_off(const Vector& sums, const Vector& sizes) {
    return (sums.array().abs() <= round_off::zero * sizes.array()).select(0.0, sums);
}

StaticResponse::StaticResponse(const Base& base, const ClosedDirections& directions)
    : resisted_(resisted_motions(base, directions)) {
    const int rigid = base.rigid_body_modes, elastic = base.modes() - rigid, d = directions.count();
    compliance_ = base.squares.tail(elastic).cwiseInverse();
    inverse_.setOnes(d);
    sprung_.setOnes(d);
    for (int j = 0; j < d; ++j) {
        const double stiffness = directions.stiffness()[j];
        if (stiffness == 0.0) sprung_[j] = 0.0;
        if (stiffness != 0.0) inverse_[j] = 1.0 / stiffness;
    }
    const auto elastic_vectors = directions.vectors().rightCols(elastic);
    deflections_ = elastic_vectors * compliance_.asDiagonal();
    flexibility_ = elastic_vectors * deflections_.transpose();
    coupling_ = directions.vectors().leftCols(rigid) * resisted_;
    make_solver(directions);
}

void StaticResponse::make_solver(const ClosedDirections& directions) {
    const Index d = coupling_.rows(), c = coupling_.cols();
    Matrix matrix = Matrix::Zero(d + c, d + c);
    matrix.topLeftCorner(d, d) = sprung_.asDiagonal() * flexibility_;
    matrix.topRightCorner(d, c) = sprung_.asDiagonal() * coupling_;
    matrix.bottomLeftCorner(c, d) = coupling_.transpose();
    matrix.diagonal().head(d) += inverse_;
    sizes_ = sizes_of_unknowns(directions);
    matrix = matrix * sizes_.asDiagonal();
    scales_.setOnes(d + c);
    for (Index i = 0; i < d + c; ++i) {
        const double largest = matrix.row(i).cwiseAbs().maxCoeff();
        if (largest > 0.0) scales_[i] = 1.0 / largest;
    }
    solver_ = LinearSolver(scales_.asDiagonal() * matrix);
}

// The flexibility of a direction gives its force a size. A rigid direction along which the structure moves as a rigid
// body does not bend: its flexibility is round-off, equilibrium gives its force, and its size is the largest other.
Vector StaticResponse::sizes_of_unknowns(const ClosedDirections& directions) const {
    const Index d = coupling_.rows(), c = coupling_.cols(), rigid = resisted_.rows();
    const Vector flexibilities = flexibility_.diagonal() + sprung_.cwiseProduct(inverse_.cwiseAbs());
    std::vector<bool> bends(static_cast<std::size_t>(d));
    double stiffest = std::numeric_limits<double>::infinity();
    for (Index j = 0; j < d; ++j) {
        const auto vector = directions.vectors().row(j);
        const bool is_bent = c == 0 || !directions.is_rigid(static_cast<int>(j)) ||
                             vector.tail(vector.size() - rigid).norm() > hardly_bends * vector.norm();
        bends[static_cast<std::size_t>(j)] = flexibilities[j] > 0.0 && is_bent;
        if (bends[static_cast<std::size_t>(j)]) stiffest = std::min(stiffest, flexibilities[j]);
    }
    if (!std::isfinite(stiffest)) stiffest = 1.0;
    Vector result = Vector::Ones(d + c);
    for (Index j = 0; j < d; ++j)
        result[j] = 1.0 / std::sqrt(bends[static_cast<std::size_t>(j)] ? flexibilities[j] : stiffest);
    if (c == 0 || d == 0) return result;
    const double largest = (result.head(d).asDiagonal() * coupling_).cwiseAbs().maxCoeff();
    if (largest > 0.0) result.tail(c).setConstant(1.0 / largest);
    return result;
}

Vector StaticResponse::unknowns(const Vector& of_directions, const Vector& of_motions) const {
    Vector right(sizes_.size());
    right << of_directions, of_motions;
    return sizes_.cwiseProduct(solver_.solution(scales_.cwiseProduct(right)));
}

Vector StaticResponse::configuration(const Vector& motion, const Vector& elastic) const {
    Vector result(resisted_.rows() + elastic.size());
    result << resisted_ * motion, elastic;
    return result;
}

StaticSolution StaticResponse::solution(const ClosedDirections& directions, const Vector& load,
                                        const Vector& offsets) const {
    const Matrix& vectors = directions.vectors();
    const Index d = coupling_.rows(), c = coupling_.cols(), elastic = compliance_.size(), rigid = resisted_.rows();
    const auto elastic_vectors = vectors.rightCols(elastic);
    const Vector elastic_load = load.tail(elastic), push = resisted_.transpose() * load.head(rigid);
    const Vector push_sizes = resisted_.cwiseAbs().transpose() * load.head(rigid).cwiseAbs();
    const Vector still = Vector::Zero(c);
    Vector found = unknowns(-offsets - sprung_.cwiseProduct(deflections_ * elastic_load), -push);
    StaticSolution result;
    result.along = found.head(d);
    const Vector terms =
        elastic_load.cwiseAbs() + elastic_vectors.cwiseAbs().transpose() * result.along.cwiseAbs();
    const Vector total = without_round_off(elastic_load + elastic_vectors.transpose() * result.along, terms);
    result.configuration = configuration(found.tail(c), compliance_.cwiseProduct(total));
    // The first correction judges y by the terms of Omega^-2 (f_e + P_e f) too; what that drops of a soft mode's
    // displacement, the next ones give again.
    Vector further_sizes = configuration(still, compliance_.cwiseProduct(terms));
    Vector force_sizes = result.along.cwiseAbs();
    for (int passed = 0; passed < most_corrections; ++passed) {
        const Vector sprung_part = inverse_.cwiseProduct(result.along);
        const Vector violation = offsets + sprung_part + sprung_.cwiseProduct(vectors * result.configuration);
        const Vector imbalance =
            without_round_off(push + coupling_.transpose() * result.along,
                              push_sizes + coupling_.cwiseAbs().transpose() * result.along.cwiseAbs());
        if (passed > 0 && (imbalance.array() == 0.0).all()) {
            const Vector stretched = vectors.cwiseAbs() * result.configuration.cwiseAbs();
            const Vector size = offsets.cwiseAbs() + sprung_part.cwiseAbs() + sprung_.cwiseProduct(stretched);
            if ((violation.array().abs() <= round_off::product * size.array()).all()) break;
        }
        found = unknowns(-violation, -imbalance);
        const Vector correction = found.head(d);
        const Vector moved = configuration(found.tail(c), deflections_.transpose() * correction);
        force_sizes += correction.cwiseAbs();
        further_sizes += result.configuration.cwiseAbs() + moved.cwiseAbs();
        result.along = without_round_off(result.along + correction, force_sizes);
        result.configuration = without_round_off(result.configuration + moved, further_sizes);
        further_sizes.setZero();
    }
    return result;
}

Deflection static_deflection(const Base& base, const std::vector<int>& closed, const Vector& load, const Vector& gaps) {
    const ClosedDirections directions(base, closed);
    const StaticResponse response(base, directions);
    StaticSolution found = response.solution(directions, load, directions.offsets(base, gaps));
    return {directions.contact_forces(base, found.along, gaps_at(base, closed, found.configuration, gaps)),
            std::move(found.configuration)};
}

Vector gaps_at(const Base& base, const std::vector<int>& closed, const Vector& configuration, const Vector& gaps) {
    Vector result = base.directions * configuration;
    for (std::size_t k = 0; k < closed.size(); ++k) result[closed[k]] += gaps[static_cast<Index>(k)];
    return result;
}

}  // namespace multiphi
