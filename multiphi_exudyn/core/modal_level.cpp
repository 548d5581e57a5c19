#include "modal_level.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <string>
#include <utility>

#include "aligned_modes.hpp"
#include "failure.hpp"
#include "level_modes.hpp"
#include "level_rows.hpp"
#include "residual_boundary.hpp"
#include "round_off.hpp"
#include "symmetric_eigenpairs.hpp"

namespace multiphi {

namespace {

constexpr double undamped = 1e-12;       // of the largest damping: round-off of projecting it
constexpr double neutral = 1e-12;        // of mu: an |omega^2| below it is round-off of zero
constexpr double nearly_neutral = 1e-7;  // of the sum of |stiffnesses| along a mode: to drop a rest costs less than round-off
constexpr double interlacing = 1e-8;     // of mu: violation of the interlacing theorem that is still round-off

std::string listed(const Base& base, const std::vector<int>& links) {
    std::string result;
    for (const int link : links) result += (result.empty() ? "" : ", ") + base.names[static_cast<std::size_t>(link)];
    return result;
}

std::vector<int> rigid_among(const Base& base, const std::vector<int>& links) {
    std::vector<int> result;
    std::copy_if(links.begin(), links.end(), std::back_inserter(result), [&](int link) { return base.is_rigid(link); });
    return result;
}

std::vector<int> sorted_links(const std::vector<int>& some, const std::vector<int>& others) {
    std::vector<int> result = some;
    result.insert(result.end(), others.begin(), others.end());
    std::sort(result.begin(), result.end());
    return result;
}

ClosedDirections independent_directions(const Base& base, std::vector<int> closed) {
    const std::vector<int> rigid = rigid_among(base, closed);
    if (!base.are_independent(rigid)) {
        throw LevelFailure("level: rigid contacts " + listed(base, rigid) + " are not independent of each other");
    }
    return ClosedDirections(base, std::move(closed));
}

// Modes with omega^2 = 0 of zero-frequency modes, and how many of them a level keeps: the lowest `most` and those that
// complete their last cluster, for which one mode more has to be known; or all.
struct KnownModes {
    LevelModes of_level;
    int kept = 0;
};

KnownModes lowest_modes(const Base& base, const ClosedDirections& directions, int free_motions, int most) {
    const int available = base.modes() - static_cast<int>(directions.rigid().size());
    for (int beyond = 1;; beyond *= 2) {
        const int count = most < available - beyond ? most + beyond : available;
        KnownModes result{level_modes(base, directions, count), 0};
        Vector& squares = result.of_level.squares;
        std::vector<Index> order(static_cast<std::size_t>(squares.size()));
        std::iota(order.begin(), order.end(), Index{0});
        std::stable_sort(order.begin(), order.end(),
                         [&](Index i, Index j) { return std::abs(squares[i]) < std::abs(squares[j]); });
        for (int k = 0; k < free_motions; ++k) squares[order[static_cast<std::size_t>(k)]] = 0.0;
        for (double& square : squares) {
            if (std::abs(square) <= neutral * result.of_level.accuracy) square = 0.0;
        }
        const int known = static_cast<int>(squares.size());
        const std::optional<int> end = most >= available || known >= available ? known : cluster_end(squares, most);
        if (end) {
            result.kept = *end;
            return result;
        }
    }
}

// Sets omega^2 to zero where negative springs cancel the stiffness along a mode but for a small rest: omega^2 is the sum
// of the stiffnesses along it. Where contacts slide, or rigid ones are closed, only round-off is zero.
void drop_cancelled(const Base& base, const std::vector<int>& closed, LevelModes& modes) {
    bool softens = false;
    for (const int link : closed) {
        if (base.is_rigid(link) || std::find(base.oblique.begin(), base.oblique.end(), link) != base.oblique.end()) return;
        softens = softens || base.stiffnesses[link] < 0.0;
    }
    if (!softens) return;
    const Vector sizes = base.stiffness_sizes(closed, modes.modes);
    for (Index i = 0; i < sizes.size(); ++i) {
        if (std::abs(modes.squares[i]) <= nearly_neutral * sizes[i]) modes.squares[i] = 0.0;
    }
}

void take_rows(Vector& squares, Matrix& modes, const std::vector<Index>& rows) {
    const Vector chosen_squares = squares(rows);
    const Matrix chosen = modes(rows, Eigen::all);
    squares = chosen_squares;
    modes = chosen;
}

// Gives modes of equal omega^2 unique bases, where some have zero frequency. Undamped ones of these come first: they
// drift for ever, damped ones come to rest.
void align_free_modes(const Base& base, const std::vector<int>& closed, Vector& squares, Matrix& modes) {
    std::vector<Index> free, others;
    for (Index i = 0; i < squares.size(); ++i) (squares[i] == 0.0 ? free : others).push_back(i);
    const Matrix moving = modes(free, Eigen::all);
    const Symmetric rates = symmetric_eigenpairs(moving * base.damped(closed, moving).transpose());
    const auto drifting = (rates.values.array() <= undamped * base.largest_damping(closed)).count();
    if (0 < drifting && drifting < moving.rows()) modes(free, Eigen::all) = rates.vectors.transpose() * moving;
    const std::vector<Index> damped(free.begin() + drifting, free.end());
    free.resize(static_cast<std::size_t>(drifting));
    for (const std::vector<Index>& part : {free, damped, others}) {
        Vector own_squares = squares;
        Matrix own = modes;
        take_rows(own_squares, own, part);
        align_clusters(own_squares, own, base.observed, base.sizes);
        squares(part) = own_squares;
        modes(part, Eigen::all) = own;
    }
}

// omega^2 (r,) lie between those of the base, but for round-off.
bool interlaces(const Base& base, const ClosedDirections& directions, const Vector& squares, double slack) {
    const auto stiffening = (directions.stiffness().array() > 0.0).count();
    const auto softening = (directions.stiffness().array() < 0.0).count();
    for (Index i = 0; i < squares.size(); ++i) {
        if (i >= softening && !(squares[i] >= base.lowest[i - softening] - slack)) return false;
        if (i + stiffening < base.modes() && !(squares[i] <= base.highest[i + stiffening] + slack)) return false;
    }
    return true;
}

double frequency(double square) { return std::copysign(std::sqrt(std::abs(square)), square) / (2.0 * std::numbers::pi); }

// The number of modes that a level keeps before those that complete a cluster.
int wanted_modes(const KeptModes& kept, const Vector& squares) {
    const int most = std::min(kept.most, static_cast<int>(squares.size()));
    if (std::isinf(kept.highest)) return most;
    const auto below = std::count_if(squares.begin(), squares.end(),
                                     [&](double square) { return frequency(square) <= kept.highest; });
    return std::min(std::max(1, static_cast<int>(below)), most);
}

}  // namespace

ModalLevel::ModalLevel(const Base& base, std::vector<int> closed, const KeptModes& kept)
    : base_(&base), directions_(independent_directions(base, std::move(closed))), static_response_(base, directions_) {
    const int free_motions = base.rigid_body_modes - static_response_.resisted();
    KnownModes known = lowest_modes(base, directions_, free_motions, kept.most);
    LevelModes& found = known.of_level;
    drop_cancelled(base, links(), found);
    const bool are_all_vibrating = (found.squares.array() != 0.0).all();
    if (!are_all_vibrating) {
        align_free_modes(base, links(), found.squares, found.modes);
        std::vector<Index> zero;
        for (Index i = 0; i < found.squares.size(); ++i) {
            if (found.squares[i] == 0.0) zero.push_back(i);
        }
        if (static_cast<int>(zero.size()) > free_motions) neutral_ = found.modes(zero, Eigen::all);
    }
    squares = found.squares.head(known.kept);
    Matrix modes = found.modes.topRows(known.kept);
    if (are_all_vibrating) align_clusters(squares, modes, base.observed, base.sizes);
    if (!interlaces(base, directions_, squares, interlacing * found.accuracy)) {
        throw LevelFailure(
            "level: its modes are not accurate (interlacing violated); are units and magnitudes of mass and stiffness "
            "right?");
    }
    const int wanted = wanted_modes(kept, squares), count = cluster_end(squares, wanted).value_or(known.kept);
    kept_beyond_ = count - wanted;
    squares.conservativeResize(count);
    modes.conservativeResize(count, modes.cols());
    vibrates_ = (squares.array() != 0.0).all();
    computed = squares;
    LevelRows rows = level_rows(base, links(), squares, std::move(modes));
    shapes = inertial = rows.modes.transpose();
    damping = std::move(rows.damping);
    gaps = std::move(rows.gaps);
    forces = std::move(rows.forces);
    force_rates = std::move(rows.force_rates);
    following = std::move(rows.following);
    if (!vibrates_) drop_damping_of_free_modes(damping);
    const auto measured = kept.measured.find(links());
    if (measured != kept.measured.end()) measure(measured->second);
}

ModalLevel::ModalLevel(const ResidualBoundary& boundary, const std::vector<int>& acting)
    : base_(&boundary.host->modal.base()),
      directions_(*base_, sorted_links(boundary.host->modal.links(), acting)), static_response_(*base_, directions_),
      neutral_(boundary.host->modal.neutral_), kept_beyond_(boundary.host->modal.kept_beyond_) {
    const ModalLevel& host = boundary.host->modal;
    std::vector<Index> places;
    for (const int link : acting)
        places.push_back(std::find(boundary.links.begin(), boundary.links.end(), link) - boundary.links.begin());
    const Matrix directions = base_->directions(acting, Eigen::all);
    const Vector compliances = boundary.compliances(places);
    const ResidualModes modes =
        residual_modes(host.squares, directions * host.shapes, boundary.flexibility(places, places), compliances);
    squares = computed = modes.squares;
    vibrates_ = (squares.array() != 0.0).all();
    const Matrix bending = boundary.shapes(places, Eigen::all).transpose() * modes.forces;
    inertial = host.shapes * modes.rotation;
    shapes = inertial + bending;
    damping = modes.rotation.transpose() * host.damping * modes.rotation;
    gaps = host.gaps * modes.rotation + boundary.gaps(Eigen::all, places) * modes.forces;
    gaps(acting, Eigen::all) = -(compliances.asDiagonal() * modes.forces);  // no difference of large terms
    following = host.following;
    const Matrix of_host =
        host.forces * modes.rotation + boundary.forces_of_host(places, Eigen::all).transpose() * modes.forces;
    forces.resize(static_cast<Index>(links().size()), squares.size());
    for (std::size_t k = 0; k < links().size(); ++k) {
        const auto own = std::find(acting.begin(), acting.end(), links()[k]);
        const auto other = std::find(host.links().begin(), host.links().end(), links()[k]);
        const Index row = static_cast<Index>(k);
        if (own != acting.end()) {
            forces.row(row) = modes.forces.row(own - acting.begin());
        } else {
            forces.row(row) = of_host.row(other - host.links().begin());
        }
    }
    force_rates = Matrix::Zero(forces.rows(), forces.cols());
}

void ModalLevel::drop_damping_of_free_modes(Matrix& matrix) const {
    const double negligible = undamped * base_->largest_damping(links());
    for (Index i = 0; i < matrix.rows(); ++i) {
        for (Index j = 0; j < matrix.cols(); ++j) {
            const bool is_free = squares[i] == 0.0 || squares[j] == 0.0;
            if (is_free && std::abs(matrix(i, j)) <= negligible) matrix(i, j) = 0.0;
        }
    }
}

void ModalLevel::measure(const Measured& measured) {
    if (measured.frequencies) {
        const Index count = std::min<Index>(measured.frequencies->size(), modes());
        squares.head(count) = (2.0 * std::numbers::pi * measured.frequencies->head(count)).cwiseAbs2();
    }
    if (!measured.ratios) return;
    const Index count = std::min<Index>(measured.ratios->size(), modes());
    damping.topRows(count).setZero();
    damping.leftCols(count).setZero();
    for (Index i = 0; i < count; ++i) damping(i, i) = (*measured.ratios)[i] * 2.0 * std::sqrt(std::abs(squares[i]));
}

std::string ModalLevel::closed_names() const {
    std::vector<std::string> shown;
    for (const int link : links()) {
        const std::string& name = base_->names[static_cast<std::size_t>(link)];
        if (!name.empty()) shown.push_back(name);
    }
    std::string result;
    for (const std::string& name : shown) result += (result.empty() ? "" : ", ") + name;
    return result;
}

ModalLevel::Response ModalLevel::response(const Vector& load, const Vector& gaps_of_closed) const {
    const Vector offsets = directions_.offsets(*base_, gaps_of_closed);
    if (has_neutral_modes()) return neutral_response(load, offsets);
    StaticSolution found = static_response_.solution(directions_, load, offsets);
    Vector unbalanced = load;
    if (!vibrates_) unbalanced += directions_.vectors().transpose() * found.along;
    return {std::move(found.along), std::move(found.configuration), std::move(unbalanced)};
}

ModalLevel::Response ModalLevel::neutral_response(const Vector& load, const Vector& offsets) const {
    if (!directions_.rigid().empty()) {
        throw LevelFailure("level " + closed_names() +
                           ": negative stiffness cancels that of a mode beside closed rigid contacts, so there is no "
                           "equilibrium");
    }
    const Vector constants = directions_.constants(offsets);
    const Vector driving = load - directions_.vectors().transpose() * constants;
    const Vector balanced = load - neutral_.transpose() * (neutral_ * driving);
    const Vector found = static_response_.solution(directions_, balanced, offsets).configuration;
    const Vector configuration = found - neutral_.transpose() * (neutral_ * found);
    const Vector along = -constants - directions_.stiffness().cwiseProduct(directions_.vectors() * configuration);
    return {along, configuration, driving};
}

Asymptotic ModalLevel::asymptotic(const Vector& load, const Vector& initial) const {
    const Base& base = *base_;
    const Response found = response(load + base.preload, initial(links()));
    Asymptotic result;
    result.configuration = found.configuration;
    const Vector& y = result.configuration;
    result.gaps = base.directions * y + initial;
    const Vector sizes = base.sizes_of_directions * y.cwiseAbs() + initial.cwiseAbs();
    for (int link = 0; link < base.links(); ++link) {
        const double negligible = following[static_cast<std::size_t>(link)] ? round_off::following : round_off::zero;
        if (!(std::abs(result.gaps[link]) > negligible * sizes[link])) result.gaps[link] = 0.0;
    }
    result.forces = directions_.contact_forces(base, found.along, result.gaps);
    result.drive = Vector::Zero(modes());
    if (!vibrates_) {
        const Vector driving = shapes.transpose() * found.unbalanced;
        result.drive = (squares.array() == 0.0).select(driving, 0.0);
    }
    result.load = load;
    result.strain = 0.5 * base.squares.dot(y.cwiseAbs2()) + base.energy_offset - base.preload.dot(y);
    for (const int link : links()) result.strain += 0.5 * base.springs[link] * result.gaps[link] * result.gaps[link];
    return result;
}

Deflection ModalLevel::deflection(const Vector& load, const Vector& gaps_of_closed) const {
    Response found = response(load, gaps_of_closed);
    const Vector all = gaps_at(*base_, links(), found.configuration, gaps_of_closed);
    return {directions_.contact_forces(*base_, found.along, all), std::move(found.configuration)};
}

// (K_l^-1 - Psi omega^-2 Psi^T) b is computed as K_l^-1 (1 - M Psi Psi^T) b: if a kept mode is soft, both terms of the
// former are large. The remaining part in the modes is round-off, and is removed. A remainder that is round-off of the
// products of a load with modes is zero: of weight on all modes of a free structure nothing remains.
Deflection ModalLevel::beside_modes(const Vector& load) const {
    Vector remainder = load - inertial * (shapes.transpose() * load);
    const double negligible = round_off::product * load.norm();
    for (double& part : remainder) {
        if (std::abs(part) <= negligible) part = 0.0;
    }
    const Vector still = Vector::Zero(static_cast<Index>(links().size()));
    if ((remainder.array() == 0.0).all()) return {still, Vector::Zero(load.size())};
    Deflection found = deflection(remainder, still);
    const Vector part = inertial.transpose() * found.configuration;
    return {found.forces - forces * part, found.configuration - shapes * part};
}

Vector ModalLevel::driving_force(const Vector& load, const Vector& gaps_of_closed) const {
    Vector result = Vector::Zero(modes());
    if (vibrates_) return result;
    const Response found = response(load, gaps_of_closed);
    const Vector terms = load.cwiseAbs() + directions_.vectors().cwiseAbs().transpose() * found.along.cwiseAbs();
    const Vector sizes = shapes.cwiseAbs().transpose() * terms;
    const Vector driving = shapes.transpose() * found.unbalanced;
    for (Index i = 0; i < modes(); ++i) {
        if (squares[i] == 0.0 && std::abs(driving[i]) > round_off::balanced * sizes[i]) result[i] = driving[i];
    }
    return result;
}

std::map<int, double> ModalLevel::static_shares(int count) const {
    const Base& base = *base_;
    const int known = cluster_end(squares, std::min(count, modes())).value_or(modes());
    std::map<int, double> result;
    const Vector still = Vector::Zero(static_cast<Index>(links().size()));
    for (int j = 0; j < directions_.count(); ++j) {
        if (directions_.is_rigid(j)) continue;
        const Vector row = directions_.vectors().row(j);
        const double flexibility = row.dot(response(row, still).configuration);
        const Vector moved = shapes.transpose() * row;
        double kept = 0.0, kept_size = 0.0;
        for (int i = 0; i < known; ++i) {
            if (computed[i] == 0.0) continue;
            kept += moved[i] * moved[i] / computed[i];
            kept_size += std::abs(moved[i] * moved[i] / computed[i]);
        }
        const double truncated = std::max(flexibility - kept, 0.0), whole = truncated + kept_size;
        // Else rigid contacts hold the gap, but for round-off.
        const bool is_moving = whole > round_off::zero * row.cwiseProduct(base.periods).squaredNorm();
        result[directions_.members()[static_cast<std::size_t>(j)][0]] = is_moving ? truncated / whole : 0.0;
    }
    return result;
}

}  // namespace multiphi
