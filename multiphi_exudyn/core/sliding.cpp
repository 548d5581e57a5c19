#include "sliding.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "decompositions.hpp"
#include "failure.hpp"
#include "round_off.hpp"

namespace multiphi {

namespace {

constexpr double determinate = 1e-10;  // relative: a smaller remainder of h.M^-1 h, or of a stiffness, is round-off

LevelFailure cancelled(const ModalLevel& level) {
    return LevelFailure("level " + level.closed_names() +
                        ": negative stiffness cancels that of a mode beside contacts that slide");
}

std::vector<int> sliding_places(const ModalLevel& level) {
    const std::vector<int>& oblique = level.base().oblique;
    std::vector<int> places;
    for (std::size_t k = 0; k < level.links().size(); ++k) {
        if (std::find(oblique.begin(), oblique.end(), level.links()[k]) != oblique.end())
            places.push_back(static_cast<int>(k));
    }
    return places;
}

}  // namespace

Sliding::Sliding(const ModalLevel& level, std::vector<int> places) : level_(&level), places_(std::move(places)) {
    if (level.has_neutral_modes()) throw cancelled(level);
    const Base& base = level.base();
    std::vector<int> links;
    for (const int place : places_) links.push_back(level.links()[static_cast<std::size_t>(place)]);
    added_ = base.force_directions(links, Eigen::all) - base.directions(links, Eigen::all);
    pulled_ = (added_ * level.shapes).transpose();
    reactions_ = static_reactions();
    check_unique_motion();
    Matrix elastic = level.forces;  // round-off of reactions would couple rigid-body modes
    for (std::size_t k = 0; k < level.links().size(); ++k) {
        for (int j = 0; j < level.modes(); ++j) {
            if (level.squares[j] == 0.0 && base.is_rigid(level.links()[k])) elastic(static_cast<Index>(k), j) = 0.0;
        }
    }
    forces_ = answered(elastic);
    force_rates_ = answered(level.force_rates);
    coupling_ = -(pulled_ * forces_(places_, Eigen::all));
    damping_ = -(pulled_ * force_rates_(places_, Eigen::all));
    if (!level.vibrates()) level.drop_damping_of_free_modes(damping_);
    for (int j = 0; j < level.modes(); ++j) {
        if (level.squares[j] == 0.0 && (coupling_.col(j).array() != 0.0).any()) throw cancelled(level);
    }
}

Matrix Sliding::answered(const Matrix& forces) const {
    const Index o = static_cast<Index>(places_.size());
    const Matrix own = Matrix::Identity(o, o) - reactions_(places_, Eigen::all);
    return forces + reactions_ * solve(own, Matrix(forces(places_, Eigen::all)));
}

// W (k, o): static reactions of rigid contacts to the part of U that truncated modes have.
Matrix Sliding::static_reactions() const {
    const ModalLevel& level = *level_;
    const Index k = static_cast<Index>(level.links().size()), o = added_.rows();
    Matrix result = Matrix::Zero(k, o);
    if (level.directions().rigid().empty()) return result;
    const Vector still = Vector::Zero(k);
    for (Index column = 0; column < o; ++column) {
        const Vector load = added_.row(column);
        Vector truncated = load - level.shapes * (level.shapes.transpose() * load);
        const double negligible = round_off::zero * load.norm();
        for (double& part : truncated) {
            if (std::abs(part) <= negligible) part = 0.0;
        }
        const Deflection found = level.deflection(truncated, still);
        const Vector in_modes = level.forces * (level.shapes.transpose() * found.configuration);
        for (Index i = 0; i < k; ++i) {
            if (level.base().is_rigid(level.links()[static_cast<std::size_t>(i)]))
                result(i, column) = found.forces[i] - in_modes[i];
        }
    }
    return result;
}

// Throws LevelFailure for friction under which the motion is not unique.
void Sliding::check_unique_motion() const {
    const Index o = static_cast<Index>(places_.size());
    const Matrix remaining = Matrix::Identity(o, o) - reactions_(places_, Eigen::all);
    for (Index count = 1; count <= o; ++count) {
        std::vector<bool> is_chosen(static_cast<std::size_t>(o));
        std::fill(is_chosen.begin(), is_chosen.begin() + count, true);
        do {  // all subsets of so many, in rising order
            std::vector<int> subset;
            for (Index i = 0; i < o; ++i) {
                if (is_chosen[static_cast<std::size_t>(i)]) subset.push_back(static_cast<int>(i));
            }
            const double minor = determinant(remaining(subset, subset));
            if (minor > determinate) continue;
            std::string names;
            for (const int i : subset) {
                const int link = level_->links()[static_cast<std::size_t>(places_[static_cast<std::size_t>(i)])];
                if (!names.empty()) names += ", ";
                names += "'" + level_->base().labels[static_cast<std::size_t>(link)] + "'";
            }
            throw LevelFailure("friction at the rigid contact " + names +
                               ": sliding has no unique motion, as h.M^-1 (h - s mu h_t) is " + text_of(minor) +
                               " of h.M^-1 h in the kept modes; need a smaller coefficient, for which it is positive, "
                               "or a finite stiffness");
        } while (std::prev_permutation(is_chosen.begin(), is_chosen.end()));
    }
}

Vector Sliding::friction(const Vector& forces) const {
    const Index o = static_cast<Index>(places_.size());
    const Vector still = Vector::Zero(forces.size());
    Matrix remaining = Matrix::Identity(o, o);
    for (Index column = 0; column < o; ++column)
        remaining.col(column) -= level_->deflection(added_.row(column), still).forces(places_);
    if (!(std::abs(determinant(remaining)) > determinate)) {
        throw LevelFailure("level " + level_->closed_names() +
                           ": friction cancels the stiffness against sliding, so there is no equilibrium");
    }
    return added_.transpose() * solve(remaining, Matrix(forces(places_)));
}

Asymptotic Sliding::asymptotic(const Vector& load, const Vector& gaps) const {
    return level_->asymptotic(load + friction(level_->asymptotic(load, gaps).forces), gaps);
}

Deflection Sliding::deflection(const Vector& load, const Vector& gaps) const {
    return level_->deflection(load + friction(level_->deflection(load, gaps).forces), gaps);
}

Vector Sliding::driving_force(const Vector& load, const Vector& gaps) const {
    return level_->driving_force(load + friction(level_->deflection(load, gaps).forces), gaps);
}

MovingLevel::MovingLevel(const Base& base, std::vector<int> closed, const KeptModes& kept)
    : modal(base, std::move(closed), kept) {
    slide();
}

MovingLevel::MovingLevel(const ResidualBoundary& boundary, const std::vector<int>& acting) : modal(boundary, acting) {
    slide();
}

void MovingLevel::slide() {
    std::vector<int> places = sliding_places(modal);
    if (!places.empty()) sliding.emplace(modal, std::move(places));
}

Matrix MovingLevel::coupling() const {
    return sliding ? sliding->coupling() : Matrix(Matrix::Zero(modal.modes(), modal.modes()));
}

Matrix MovingLevel::damping_matrix() const {
    return sliding ? Matrix(modal.damping + sliding->damping()) : modal.damping;
}

Asymptotic MovingLevel::asymptotic(const Vector& load, const Vector& gaps) const {
    return sliding ? sliding->asymptotic(load, gaps) : modal.asymptotic(load, gaps);
}

Deflection MovingLevel::deflection(const Vector& load, const Vector& gaps) const {
    return sliding ? sliding->deflection(load, gaps) : modal.deflection(load, gaps);
}

Vector MovingLevel::driving_force(const Vector& load, const Vector& gaps) const {
    return sliding ? sliding->driving_force(load, gaps) : modal.driving_force(load, gaps);
}

}  // namespace multiphi
