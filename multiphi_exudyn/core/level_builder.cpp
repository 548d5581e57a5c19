#include "level_builder.hpp"

#include <algorithm>
#include <utility>

#include "channels.hpp"

namespace multiphi {

namespace {

// The static loads with the constant forces of elements in their states.
Vector whole_load(const Model& model, const Excitation& excitation, const Key& key) {
    Vector load = excitation.static_load;
    for (int i = 0; i < model.size(); ++i) {
        const double force = model.elements[i].states[key[i]].force;
        if (force != 0.0) load += force * model.base.directions.row(i).transpose();
    }
    return load;
}

// Strain energy [J] of links that keep a stretch without acting.
double stored_energy(const Model& model, const Key& key) {
    double energy = 0.0;
    for (int i = 0; i < model.size(); ++i) {
        const double stretch = model.elements[i].states[key[i]].stretch;
        if (stretch != 0.0) energy += 0.5 * model.base.stiffnesses[i] * stretch * stretch;
    }
    return energy;
}

Matrix beside(const Matrix& left, const Matrix& right) {
    Matrix result(left.rows(), left.cols() + right.cols());
    result << left, right;
    return result;
}

}  // namespace

LevelData build_level(const Model& model, const Excitation& excitation, const MovingLevel& moving, const Key& key,
                      double duration) {
    const ModalLevel& modal = moving.modal;
    Asymptotic rest = moving.asymptotic(whole_load(model, excitation, key), model.gaps);
    Channels channels(moving, excitation);
    ChannelGaps channel_gaps(modal, excitation, channels);
    LevelData data;
    data.key = key;
    data.links = modal.links();
    data.squares = modal.squares;
    data.computed = modal.computed;
    data.damping = modal.damping;
    data.damping_matrix = moving.damping_matrix();
    data.coupling = moving.coupling();
    data.modes = modal.inertial;
    if (std::any_of(data.links.begin(), data.links.end(), [&](int link) { return modal.base().is_residual(link); }))
        data.bending = modal.shapes - modal.inertial;
    data.configuration = std::move(rest.configuration);
    data.static_drive = data.drive = std::move(rest.drive);
    if (excitation.steady >= 0) {
        channels.force.col(excitation.steady) += data.drive;
        data.drive.setZero();
    }
    data.load = std::move(rest.load);
    data.strain = rest.strain;
    data.stored = stored_energy(model, key);
    data.gap_rows = beside(modal.gaps, channel_gaps.gaps);
    data.gap_constants = std::move(rest.gaps);
    data.velocity_rows = beside(modal.gaps, channel_gaps.velocities);
    data.force_rows = beside(moving.forces(), channels.contact_force);
    data.force_velocity_rows = beside(moving.force_rates(), channels.contact_force_rate);
    data.forces = std::move(rest.forces);
    data.channel_force = std::move(channels.force);
    data.channel_force_rate = std::move(channels.force_rate);
    data.channel_shapes = std::move(channels.shapes);
    data.carried = std::move(channels.carried);
    data.duration = duration;
    return data;
}

}  // namespace multiphi
