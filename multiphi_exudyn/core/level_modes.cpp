#include "level_modes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "decompositions.hpp"
#include "failure.hpp"
#include "orthonormal.hpp"
#include "secular_equation.hpp"
#include "jacobi_singular_values.hpp"

namespace multiphi {

namespace {

constexpr double nearly_indefinite = 0.5;  // share of a stiffness that negative springs may take before mu is needed
constexpr int few = 4;                 // modes of the base for each requested one, from which iterations are cheaper
constexpr double changes = 130'000.0;  // (d - 1) m^2, up to which d rank-one changes cost less than iterations
constexpr int changed = 4;             // modes of the base for each direction, up to which changes keep their accuracy
constexpr double orthogonal = 1e-12;   // product of two modes, above which they are recomputed in their space
constexpr double orthonormal = 1e-10;  // largest allowed |Psi^T Psi - I|

double product_error(const Matrix& modes) {
    return largest_product_error(modes.data(), static_cast<int>(modes.cols()), static_cast<int>(modes.rows()));
}

// Orthonormal rows that span the same space as given ones.
Matrix orthonormal_rows(const Matrix& vectors) {
    return orthogonal_triangular(vectors.transpose()).basis.transpose();
}

// W (s, r) without its parts on modes of frequency zero, over the roots of squares.
Matrix divided(const Matrix& softening, const Vector& roots) {
    return softening * (roots.array() > 0.0).select(roots.array().inverse(), 1.0).matrix().asDiagonal();
}

// The largest eigenvalue of B^-1 W W^T B^-1, B^2 = diag(squares): above 1 the stiffness is indefinite. W (s, r).
double share(const Vector& squares, const Matrix& softening) {
    for (Index i = 0; i < squares.size(); ++i) {
        if (squares[i] <= 0.0 && (softening.col(i).array() != 0.0).any()) return std::numeric_limits<double>::infinity();
    }
    const double largest = left_singular_vectors(divided(softening, squares.cwiseMax(0.0).cwiseSqrt())).values.maxCoeff();
    return largest * largest;
}

// The modes of diag(squares) - W^T W, W (s, r), in the coordinates of given modes.
LevelModes softened(const LevelModes& given, const Matrix& softening) {
    const Vector& squares = given.squares;
    double shift = 0.0;
    if (!(share(squares, softening) <= nearly_indefinite)) {
        const double norm = left_singular_vectors(softening).values.maxCoeff();
        shift = 2.0 * norm * norm;
        while (shift > 0.0 && share(squares.array() + shift / 2.0, softening) <= nearly_indefinite) shift /= 2.0;
    }
    const Vector root = (squares.array() + shift).sqrt();
    const LeftSingularVectors removed = left_singular_vectors(divided(softening, root).transpose());
    const Vector reduced = 1.0 - (1.0 - removed.values.array().square()).sqrt();
    Matrix factor = -(removed.vectors * reduced.asDiagonal() * removed.vectors.transpose()) * root.asDiagonal();
    factor.diagonal() += root;
    JacobiSingularValues found = jacobi_singular_values(factor);
    const double offset = std::sqrt(shift);
    LevelModes result;
    result.squares = (found.values.array() - offset) * (found.values.array() + offset);
    result.modes = found.vectors * given.modes;
    result.accuracy = shift;
    return result;
}

// Modes in a space whose orthonormal rows are `free` (f, m).
LevelModes singular_value_modes(const Base& base, const ClosedDirections& directions, const Matrix& free) {
    std::vector<int> stiffening;
    for (int j = 0; j < directions.count(); ++j) {
        if (directions.stiffness()[j] > 0.0 && !directions.is_rigid(j)) stiffening.push_back(j);
    }
    Matrix stacked(base.modes() + static_cast<Index>(stiffening.size()), free.rows());
    stacked.topRows(base.modes()) = base.omega.asDiagonal() * free.transpose();
    for (std::size_t j = 0; j < stiffening.size(); ++j) {
        stacked.row(base.modes() + static_cast<Index>(j)) =
            std::sqrt(directions.stiffness()[stiffening[j]]) * (free * directions.vectors().row(stiffening[j]).transpose());
    }
    const JacobiSingularValues found = jacobi_singular_values(stacked);
    return {found.values.cwiseAbs2(), found.vectors * free, 0.0};
}

// Lowest modes by one change of rank one after the other, each of the modes that those before it have left; all of
// these are needed until the last one. None where a secular equation has no solution.
std::optional<LevelModes> rank_one_changes(const Base& base, const ClosedDirections& directions, int count) {
    const std::vector<int>& resisting = directions.resisting();
    Vector squares = base.squares;
    std::vector<Matrix> changed_modes;
    for (const int j : resisting) {
        Vector direction = directions.vectors().row(j);
        for (const Matrix& change : changed_modes) direction = change * direction;
        const bool is_last = j == resisting.back();
        const int left = static_cast<int>(squares.size()) - (directions.is_rigid(j) ? 1 : 0);
        if (left < 1) return std::nullopt;
        std::optional<RankOneModes> found =
            rank_one_modes(squares, direction, directions.stiffness()[j], is_last ? std::min(count, left) : left);
        if (!found) return std::nullopt;
        squares = std::move(found->values);
        changed_modes.push_back(std::move(found->vectors));
    }
    Matrix modes = std::move(changed_modes.back());
    for (std::size_t j = changed_modes.size() - 1; j-- > 0;) modes = modes * changed_modes[j];
    if (resisting.size() > 1 && !directions.rigid().empty()) modes = without(directions.pinned(), modes);
    return LevelModes{std::move(squares), std::move(modes), 0.0};
}

LevelModes cheapest(const Base& base, const ClosedDirections& directions, int count) {
    const int m = base.modes(), d = static_cast<int>(directions.resisting().size());
    const bool is_stiffer = d > 0 && directions.stiffness().minCoeff() >= 0.0;
    const bool iterates = is_stiffer && few * count <= m && base.rigid_body_modes == 0 &&
                          (d - 1.0) * m * m > changes;
    if (iterates) {
        const std::vector<int>& resisting = directions.resisting();
        std::optional<Matrix> vectors =
            lanczos_modes(base, directions.vectors()(resisting, Eigen::all), directions.stiffness()(resisting), count);
        if (vectors) {
            if (!directions.rigid().empty()) vectors = without(directions.pinned(), *vectors);
            return singular_value_modes(base, directions, orthonormal_rows(*vectors));
        }
    }
    if (is_stiffer && changed * (d - 1) <= m) {
        if (std::optional<LevelModes> found = rank_one_changes(base, directions, count)) return *found;
    }
    LevelModes result = singular_value_modes(base, directions, null_space(directions.pinned().transpose()).transpose());
    std::vector<int> softening;
    for (int j = 0; j < directions.count(); ++j) {
        if (directions.stiffness()[j] < 0.0) softening.push_back(j);
    }
    if (softening.empty() || result.modes.rows() == 0) return result;
    const Vector roots = (-directions.stiffness()(softening)).cwiseSqrt();
    return softened(result, roots.asDiagonal() * directions.vectors()(softening, Eigen::all) * result.modes.transpose());
}

}  // namespace

LevelModes level_modes(const Base& base, const ClosedDirections& directions, int count) {
    if (directions.count() == 0) {
        const int r = std::min(count, base.modes());
        return {base.squares.head(r), Matrix::Identity(r, base.modes()), 0.0};
    }
    LevelModes result = cheapest(base, directions, count);
    if (result.modes.rows() == 0) return result;
    double error = product_error(result.modes);
    if (error > orthogonal) {
        result = singular_value_modes(base, directions, orthonormal_rows(result.modes));
        error = product_error(result.modes);
    }
    if (!(error <= orthonormal)) {
        throw LevelFailure("level: its modes are not accurate (mass normalisation off by " + text_of(error) +
                           "); are units and magnitudes of mass and stiffness right?");
    }
    return result;
}

}  // namespace multiphi
