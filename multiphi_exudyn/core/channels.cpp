#include "channels.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "decompositions.hpp"
#include "round_off.hpp"

namespace multiphi {

namespace {

constexpr double small_difference = 1e-3;  // of the sum of |stiffnesses| along a mode: such an omega^2 has lost three digits

// The stops (k, q) of the closed links, of rigid ones or of springs alone.
enum class Which { all, rigid, springs };

Matrix stops_of(const ModalLevel& level, const Excitation& excitation, Which which) {
    Matrix result = excitation.stops(level.links(), Eigen::all);
    if (which == Which::all) return result;
    for (std::size_t k = 0; k < level.links().size(); ++k) {
        if (level.base().constrains(level.links()[k]) != (which == Which::rigid)) result.row(static_cast<Index>(k)).setZero();
    }
    return result;
}

// Configurations (m, q) and contact forces (k, q) in response to gaps (k,) of each channel.
template <typename Level>
void respond_to_stops(const Level& level, const Matrix& stops, Index channel, Matrix& configurations, Matrix* forces) {
    if ((stops.col(channel).array() == 0.0).all()) return;
    const Deflection found = level.deflection(Vector::Zero(configurations.rows()), -stops.col(channel));
    configurations.col(channel) = found.configuration;
    if (forces != nullptr) forces->col(channel) = found.forces;
}

// omega^-2 P (r, q), zero on zero-frequency modes.
Matrix centre(const Matrix& force, const Vector& squares) {
    const Vector inverse = (squares.array() != 0.0).select(squares.array().inverse(), 0.0);
    return inverse.asDiagonal() * force;
}

}  // namespace

Channels::Channels(const MovingLevel& level, const Excitation& excitation) {
    const ModalLevel& modal = level.modal;
    const Index m = modal.base().modes(), r = modal.modes(), q = excitation.channels();
    const Index k = static_cast<Index>(modal.links().size());
    for (Matrix* of_modes : {&force, &force_rate}) of_modes->setZero(r, q);
    for (Matrix* of_base : {&carried, &shapes, &sizes}) of_base->setZero(m, q);
    for (Matrix* of_forces : {&contact_force, &contact_force_rate}) of_forces->setZero(k, q);
    if (q == 0) return;
    add_loads(modal, excitation);
    add_stops(level, excitation);
    add_rates(modal, excitation);
    if (level.sliding) add_friction(*level.sliding, excitation.prescribed);
}

void Channels::add_loads(const ModalLevel& level, const Excitation& excitation) {
    const Matrix& psi = level.shapes;
    const Base& base = level.base();
    force = psi.transpose() * excitation.patterns;
    const Matrix centres = centre(force, level.computed);
    for (Index channel = 0; channel < excitation.prescribed; ++channel) {
        const Vector pattern = excitation.patterns.col(channel);
        const double length = pattern.norm();
        Deflection beside = level.beside_modes(pattern);
        const Vector modal = psi.cwiseAbs() * centres.col(channel).cwiseAbs();
        shapes.col(channel) = without_round_off(beside.configuration, modal);  // none if it has all modes
        Vector& forces = beside.forces;
        for (std::size_t k = 0; k < level.links().size(); ++k) {
            const int link = level.links()[k];
            const Index place = static_cast<Index>(k);
            const double negligible = round_off::zero * length / base.sizes[link];
            if (base.constrains(link) && std::abs(forces[place]) <= negligible) forces[place] = 0.0;
        }
        contact_force.col(channel) = forces;
    }
}

void Channels::add_stops(const MovingLevel& moving, const Excitation& excitation) {
    const ModalLevel& level = moving.modal;
    const Base& base = level.base();
    const Matrix& psi = level.shapes;
    const Index m = base.modes(), q = excitation.channels(), prescribed = excitation.prescribed;
    const Matrix stops = stops_of(level, excitation, Which::all);
    const Matrix rigid = stops_of(level, excitation, Which::rigid);
    Matrix pushes = stops_of(level, excitation, Which::springs);
    Matrix moved = Matrix::Zero(m, q), forces_moved = Matrix::Zero(stops.rows(), q);
    for (Index channel = 0; channel < q; ++channel) {
        // The static response to constant channels contains friction.
        if (channel < prescribed) {
            respond_to_stops(level, stops, channel, moved, &forces_moved);
        } else {
            respond_to_stops(moving, stops, channel, moved, &forces_moved);
        }
        respond_to_stops(level, rigid, channel, carried, nullptr);
    }
    const bool pushes_springs = (pushes.array() != 0.0).any();
    Matrix sprung = Matrix::Zero(level.modes(), q);
    if (pushes_springs) {
        const Matrix stretches = pushes;
        Matrix pushed = Matrix::Zero(level.modes(), q);
        for (std::size_t k = 0; k < level.links().size(); ++k) {
            const int link = level.links()[k];
            const Index place = static_cast<Index>(k);
            if (base.is_residual(link)) pushed -= level.forces.row(place).transpose() * stops.row(place);
            pushes.row(place) *= base.is_residual(link) ? 0.0 : base.springs[link];
        }
        pushed += psi.transpose() * (base.directions(level.links(), Eigen::all).transpose() * pushes);
        force += pushed;
        sprung = centre(pushed, level.computed);
        // Of modes whose omega^2 has few digits, the static response, large in them, is removed as it was computed.
        const Vector stiffness_sizes = base.stiffness_sizes(level.links(), psi.transpose());
        Matrix stretched = Matrix::Zero(m, q);
        bool is_computed = false;
        for (int i = 0; i < level.modes(); ++i) {
            if (level.computed[i] == 0.0 || std::abs(level.computed[i]) > small_difference * stiffness_sizes[i]) continue;
            for (Index channel = 0; channel < q && !is_computed; ++channel)
                respond_to_stops(level, stretches, channel, stretched, nullptr);
            is_computed = true;
            sprung.row(i) = psi.col(i).transpose() * stretched;
        }
    }
    const Matrix centres = centre(force, level.computed);
    Matrix modal = centres - centre(force, level.squares) - sprung;
    modal.rightCols(q - prescribed).setZero();  // the motion is centred on the whole static response to these,
    for (Index channel = prescribed; channel < q; ++channel)  // and modes without a centre are driven
        force.col(channel) = moving.driving_force(Vector::Zero(m), -stops.col(channel));
    shapes += moved + psi * modal;
    contact_force += forces_moved + level.forces * modal;
    sizes = moved.cwiseAbs() + psi.cwiseAbs() * centres.cwiseAbs();
}

// What the velocities of stops add: dampers of viscous contacts, and the inertia of what rigid ones carry.
void Channels::add_rates(const ModalLevel& level, const Excitation& excitation) {
    const Base& base = level.base();
    const std::vector<int>& links = level.links();
    std::vector<int> rigid;
    for (std::size_t k = 0; k < links.size(); ++k) {
        if (base.constrains(links[k])) rigid.push_back(static_cast<int>(k));
    }
    const Matrix directions = base.directions(links, Eigen::all);
    const Matrix pinned = directions(rigid, Eigen::all).transpose();
    for (std::size_t channel = 0; channel < excitation.rate_of.size(); ++channel) {
        const int derivative = excitation.rate_of[channel];
        if (derivative < 0) continue;
        const Vector motion = carried.col(static_cast<Index>(channel));
        const Vector stops = excitation.stops(links, static_cast<Index>(channel));
        const Vector dampers = base.dampings(links).cwiseProduct(stops - directions * motion);  // forces at w' = 1
        const Vector damped = base.damping * motion - directions.transpose() * dampers;
        force.col(derivative) -= level.inertial.transpose() * damped;
        force_rate.col(derivative) -= level.inertial.transpose() * motion;
        for (std::size_t k = 0; k < links.size(); ++k) {
            if (!base.constrains(links[k])) contact_force(static_cast<Index>(k), derivative) += dampers[static_cast<Index>(k)];
        }
        if (rigid.empty()) continue;
        const Vector held = least_squares(pinned, damped), accelerated = least_squares(pinned, motion);
        for (std::size_t k = 0; k < rigid.size(); ++k) {
            contact_force(rigid[k], derivative) += held[static_cast<Index>(k)];
            contact_force_rate(rigid[k], derivative) += accelerated[static_cast<Index>(k)];
        }
    }
}

void Channels::add_friction(const Sliding& sliding, int prescribed) {
    const Matrix answered = sliding.answered(contact_force);
    contact_force.leftCols(prescribed) = answered.leftCols(prescribed);
    contact_force_rate = sliding.answered(contact_force_rate);
    force.leftCols(prescribed) += sliding.pulled() * contact_force(sliding.places(), Eigen::seqN(0, prescribed));
    force_rate += sliding.pulled() * contact_force_rate(sliding.places(), Eigen::all);
}

// Rows of gaps that others determine: channels move these by round-off only, or with their own stops where the closed
// contacts' stops stand still.
ChannelGaps::ChannelGaps(const ModalLevel& level, const Excitation& excitation, const Channels& channels) {
    const Base& base = level.base();
    const Matrix& stops = excitation.stops;
    gaps = base.directions * channels.shapes - stops;
    velocities = base.directions * channels.carried - stops;
    const Matrix rigid = stops_of(level, excitation, Which::rigid);
    for (Index link = 0; link < gaps.rows(); ++link) {
        if (!level.following[static_cast<std::size_t>(link)]) continue;
        for (Index channel = 0; channel < gaps.cols(); ++channel) {
            const double stop = stops(link, channel);
            if ((rigid.col(channel).array() == 0.0).all()) {
                gaps(link, channel) = velocities(link, channel) = -stop;
                continue;
            }
            const auto direction = base.sizes_of_directions.row(link);
            const double size = direction.dot(channels.sizes.col(channel)) + std::abs(stop);
            const double speed = direction.dot(channels.carried.col(channel).cwiseAbs()) + std::abs(stop);
            if (std::abs(gaps(link, channel)) <= round_off::following * size) gaps(link, channel) = 0.0;
            if (std::abs(velocities(link, channel)) <= round_off::following * speed) velocities(link, channel) = 0.0;
        }
    }
}

}  // namespace multiphi
