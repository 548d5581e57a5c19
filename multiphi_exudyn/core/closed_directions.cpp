#include "closed_directions.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "decompositions.hpp"

namespace multiphi {

namespace {

constexpr double cancelled = 1e-13;  // of sum |k|: a total stiffness of a force law below it is round-off of zero

// Where a link stands among the closed ones.
Index place_of(const std::vector<int>& closed, int link) {
    return std::find(closed.begin(), closed.end(), link) - closed.begin();
}

}  // namespace

ClosedDirections::ClosedDirections(const Base& base, std::vector<int> closed) : closed_(std::move(closed)) {
    merge(base);
    const Index d = static_cast<Index>(members_.size());
    vectors_.resize(d, base.modes());
    stiffness_.resize(d);
    for (Index j = 0; j < d; ++j) {
        const std::vector<int>& links = members_[static_cast<std::size_t>(j)];
        vectors_.row(j) = base.directions.row(base.parallel[links[0]]);
        double sum = 0.0, size = 0.0;
        for (const int link : links) {
            sum += base.stiffnesses[link];
            size += std::abs(base.stiffnesses[link]);
        }
        if (links.size() > 1 && std::isfinite(sum) && std::abs(sum) <= cancelled * size) sum = 0.0;
        stiffness_[j] = sum;
        if (std::isinf(sum)) rigid_.push_back(static_cast<int>(j));
        if (sum != 0.0) resisting_.push_back(static_cast<int>(j));
    }
    orthogonalise();
}

// Gathers the links of each direction; every rigid one of a direction but the first is a direction of its own.
void ClosedDirections::merge(const Base& base) {
    std::vector<int> firsts;
    std::vector<std::vector<int>> groups;
    for (const int link : closed_) {
        const int first = base.parallel[link];
        const auto found = std::find(firsts.begin(), firsts.end(), first);
        if (found == firsts.end()) {
            firsts.push_back(first);
            groups.push_back({link});
        } else {
            groups[static_cast<std::size_t>(found - firsts.begin())].push_back(link);
        }
    }
    for (const std::vector<int>& group : groups) {
        std::vector<int> merged, further;
        bool has_rigid = false;
        for (const int link : group) {
            const bool is_further = base.is_rigid(link) && has_rigid;
            (is_further ? further : merged).push_back(link);
            has_rigid = has_rigid || base.is_rigid(link);
        }
        members_.push_back(merged);
        for (const int link : further) members_.push_back({link});
    }
}

void ClosedDirections::orthogonalise() {
    if (rigid_.size() < 2) return;
    const Matrix directions = pinned();
    double length = directions.rowwise().norm().maxCoeff();
    if (!(length > 0.0)) length = 1.0;
    const OrthogonalTriangular factors = orthogonal_triangular((directions / length).transpose());
    triangle_ = factors.triangle;
    vectors_(rigid_, Eigen::all) = length * factors.basis.transpose();
}

bool ClosedDirections::is_rigid(int direction) const { return std::isinf(stiffness_[direction]); }

double ClosedDirections::size() const {
    return resisting_.empty() ? 0.0 : vectors_(resisting_, Eigen::all).rowwise().norm().maxCoeff();
}

Vector ClosedDirections::offsets(const Base& base, const Vector& gaps) const {
    Vector result(count());
    for (int j = 0; j < count(); ++j) {
        double sum = 0.0;
        for (const int link : members_[j]) {
            const double gap = base.orientation[link] * gaps[place_of(closed_, link)];
            if (members_[j].size() == 1 || base.is_rigid(link)) {
                sum = gap;
                break;
            }
            sum += base.stiffnesses[link] * gap;
        }
        const bool is_sum = members_[j].size() > 1 && !is_rigid(j);
        result[j] = is_sum && stiffness_[j] != 0.0 ? sum / stiffness_[j] : sum;
    }
    if (triangle_.size() > 0) {
        const Vector given = result(rigid_);
        const Vector solved = triangle_.transpose().triangularView<Eigen::Lower>().solve(given);
        result(rigid_) = solved;
    }
    return result;
}

Vector ClosedDirections::constants(const Vector& offsets) const {
    Vector result = offsets;
    for (int j = 0; j < count(); ++j) {
        if (is_rigid(j)) {
            result[j] = 0.0;
        } else if (stiffness_[j] != 0.0) {
            result[j] *= stiffness_[j];
        }
    }
    return result;
}

Vector ClosedDirections::contact_forces(const Base& base, const Vector& along, const Vector& gaps) const {
    Vector given = along, forces = Vector::Zero(static_cast<Index>(closed_.size()));
    if (triangle_.size() > 0) {
        const Vector orthogonal = along(rigid_), own = triangle_.triangularView<Eigen::Upper>().solve(orthogonal);
        given(rigid_) = own;
    }
    for (int j = 0; j < count(); ++j) {
        const std::vector<int>& links = members_[j];
        const auto rigid = std::find_if(links.begin(), links.end(), [&](int link) { return base.is_rigid(link); });
        double force = given[j];
        if (links.size() == 1) {
            forces[place_of(closed_, links[0])] = base.orientation[links[0]] * force;
            continue;
        }
        // The gap of the rigid contact is round-off of zero.
        const double offset = rigid == links.end() ? 0.0 : base.orientation[*rigid] * gaps[*rigid];
        for (const int link : links) {
            if (base.is_rigid(link)) continue;
            const double spring = -base.stiffnesses[link] * (gaps[link] - base.orientation[link] * offset);
            forces[place_of(closed_, link)] = spring;
            force -= base.orientation[link] * spring;
        }
        if (rigid != links.end()) forces[place_of(closed_, *rigid)] = base.orientation[*rigid] * force;
    }
    return forces;
}

}  // namespace multiphi
