#include "level_rows.hpp"

#include <cmath>
#include <limits>
#include <utility>

#include "aligned_modes.hpp"
#include "orthonormal.hpp"
#include "round_off.hpp"

namespace multiphi {

namespace {

// Weighted fits of vectors by a few directions, by Gram-Schmidt.
class Fit {
  public:
    // directions: (c, m), independent.
    explicit Fit(Matrix directions) : directions_(std::move(directions)) {}

    // Sets the coefficients (c, n) of the directions that fit residuals (n, m) best; overwrites these.
    void coefficients(const Vector& weights, Matrix& residuals, Matrix& result) {
        const int m = static_cast<int>(directions_.cols());
        const Index c = directions_.rows(), count = residuals.rows();
        columns_ = directions_;
        triangle_.resize(c, c);
        result.resize(c, count);
        for (Index p = 0; p < c; ++p) {
            const double* column = columns_.row(p).data();
            weighted_ = weights.cwiseProduct(columns_.row(p).transpose());
            const double square = scalar_product(weighted_.data(), column, m);
            for (Index q = p + 1; q < c; ++q) {
                double* other = columns_.row(q).data();
                triangle_(p, q) = scalar_product(weighted_.data(), other, m) / square;
                add_multiple(other, -triangle_(p, q), column, m);
            }
            for (Index q = 0; q < count; ++q) {
                double* other = residuals.row(q).data();
                result(p, q) = scalar_product(weighted_.data(), other, m) / square;
                if (p + 1 < c) add_multiple(other, -result(p, q), column, m);
            }
        }
        for (Index p = c - 1; p >= 0; --p) {
            for (Index q = p + 1; q < c; ++q) result.row(p) -= triangle_(p, q) * result.row(q);
        }
    }

  private:
    Matrix directions_, columns_, triangle_;
    Vector weighted_;
};

// The smallest Omega^2 above zero, 1 where there is none.
double smallest_of(const Eigen::Ref<const Vector>& squares) {
    double smallest = std::numeric_limits<double>::infinity();
    for (const double square : squares) {
        if (0.0 < square && square < smallest) smallest = square;
    }
    return std::isfinite(smallest) ? smallest : 1.0;
}

// Ratio of neighbouring omega^2 above which the lower mode is slow: it hardly bends what the others bend.
constexpr double slow = 1e6;

// The share (r,) of a link's length below which its gap in a mode is round-off.
//
// A slow mode rests f / omega^2 away: the springs that hardly bend in it carry a force of the others' order there. Its
// gaps count in proportion to its omega^2, down to the round-off of a product.
Vector negligible_gaps(const Vector& squares) {
    Vector shares = Vector::Constant(squares.size(), round_off::zero);
    for (Index j = squares.size() - 2; j >= 0; --j) {
        const double above = squares[j + 1];
        if (squares[j] > 0.0 && squares[j] * slow < above) shares.head(j + 1).array() *= squares[j] / above;
    }
    return shares.cwiseMax(round_off::product);
}

std::vector<int> links_at(const std::vector<int>& closed, const std::vector<int>& places) {
    std::vector<int> links;
    for (const int place : places) links.push_back(closed[place]);
    return links;
}

// Sets the reactions of the rigid links; the forces of springs are there. Overwrites C_l psi.
void set_reactions(const Base& base, const std::vector<int>& closed, const std::vector<int>& rigid,
                   const Vector& squares, Matrix& damped, LevelRows& rows) {
    Fit fit(base.directions(links_at(closed, rigid), Eigen::all));
    const double smallest = smallest_of(base.squares);
    Matrix residual(1, base.modes()), reactions;
    Vector weights(base.modes());
    for (Index j = 0; j < squares.size(); ++j) {
        for (Index i = 0; i < weights.size(); ++i) {
            const double sum = base.squares[i] + std::abs(squares[j]);
            weights[i] = 1.0 / (sum > 0.0 ? sum : smallest);  // of zero Omega^2 and omega^2: the largest other one
        }
        for (Index i = 0; i < residual.cols(); ++i) {
            residual(0, i) = (base.squares[i] - squares[j]) * rows.modes(j, i);
        }
        for (std::size_t p = 0; p < closed.size(); ++p) {
            const double force = rows.forces(static_cast<Index>(p), j);
            if (force != 0.0) residual.row(0) -= base.directions.row(closed[p]) * force;
        }
        fit.coefficients(weights, residual, reactions);
        rows.forces(rigid, j) = reactions.col(0);
    }
    fit.coefficients(weights.setOnes(), damped, reactions);
    rows.force_rates(rigid, Eigen::all) = reactions;
}

}  // namespace

LevelRows level_rows(const Base& base, const std::vector<int>& closed, const Vector& squares, Matrix modes) {
    const Vector sign = signs(modes, base.observed, base.sizes);
    modes = sign.asDiagonal() * modes;
    Matrix damped = base.damped(closed, modes);
    Matrix damping = modes * damped.transpose();
    Matrix gaps = base.directions * modes.transpose();
    std::vector<int> rigid;
    for (std::size_t p = 0; p < closed.size(); ++p) {
        if (base.is_rigid(closed[p])) rigid.push_back(static_cast<int>(p));
    }
    OrthonormalBasis held;
    span(base.directions, base.lengths(), links_at(closed, rigid), held);
    const std::vector<bool> holds = following(base.directions, base.lengths(), held);
    const Vector negligible = negligible_gaps(squares);
    for (Index i = 0; i < gaps.rows(); ++i) {
        for (Index j = 0; j < gaps.cols(); ++j) {
            if (holds[i] || std::abs(gaps(i, j)) <= negligible[j] * base.sizes[i]) gaps(i, j) = 0.0;
        }
    }
    const Index k = static_cast<Index>(closed.size());
    Matrix forces(k, gaps.cols()), force_rates(k, gaps.cols());
    for (Index p = 0; p < k; ++p) {
        forces.row(p) = -base.springs[closed[p]] * gaps.row(closed[p]);
        force_rates.row(p) = -base.dampings[closed[p]] * gaps.row(closed[p]);
    }
    LevelRows rows{std::move(modes),  std::move(damping),     std::move(gaps),
                   std::move(forces), std::move(force_rates), holds};
    if (!rigid.empty()) set_reactions(base, closed, rigid, squares, damped, rows);
    return rows;
}

}  // namespace multiphi
