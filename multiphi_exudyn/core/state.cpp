#include "state.hpp"

#include <algorithm>
#include <cmath>

#include "round_off.hpp"

namespace multiphi {

void State::enter(const Level& entered) {
    level = &entered;
    const Index n = entered.width();
    for (Vector* part : {&displacement, &velocity, &displacement_scale, &velocity_scale, &mapped_displacement,
                         &mapped_velocity})
        part->resize(n);
    phases.resize(entered.guards().size());
}

void measure(State& state, const Inputs& inputs) {
    const Level& level = *state.level;
    const int r = level.modes(), q = level.prescribed();
    for (int i = 0; i < r; ++i) {
        state.displacement_scale[i] = std::abs(state.velocity[i]) * level.periods()[i];
        state.velocity_scale[i] = std::abs(state.displacement[i]) * level.omega()[i];
    }
    for (int k = 0; k < level.channels(); ++k) {
        state.displacement_scale[r + k] = k < q ? inputs.value_sizes()[k] : 0.0;
        state.velocity_scale[r + k] = k < q ? inputs.rate_sizes()[k] : 0.0;
    }
    state.mapped_displacement.setZero();
    state.mapped_velocity.setZero();
}

void keep_scales(State& state, const State& earlier) {
    for (int i = 0; i < state.level->modes(); ++i) {
        state.displacement_scale[i] = std::max(state.displacement_scale[i], earlier.displacement_scale[i]);
        state.mapped_displacement[i] = std::max(state.mapped_displacement[i], earlier.mapped_displacement[i]);
        state.mapped_velocity[i] = std::max(state.mapped_velocity[i], earlier.mapped_velocity[i]);
        state.velocity_scale[i] = std::max(state.velocity_scale[i], earlier.velocity_scale[i]);
    }
}

void clear_turning_velocities(State& state) {
    for (int i = 0; i < state.level->modes(); ++i)
        if (std::abs(state.velocity[i]) <= round_off::zero * state.velocity_scale[i]) state.velocity[i] = 0.0;
}

void accelerate(const State& state, const Inputs& inputs, Vector& result) {
    const Level& level = *state.level;
    const int r = level.modes(), n = level.width(), q = level.prescribed();
    result.resize(n);
    for (int i = 0; i < r; ++i) {
        double total = level.constant_acceleration()[i];
        for (int j = 0; j < n; ++j)
            total += level.displacement_acceleration()(i, j) * state.displacement[j] +
                     level.velocity_acceleration()(i, j) * state.velocity[j];
        result[i] = total;
    }
    for (int k = 0; k < n - r; ++k) result[r + k] = k < q ? inputs.accelerations()[k] : 0.0;
}

void acceleration_sizes(const State& state, const Inputs& inputs, Vector& result) {
    const Level& level = *state.level;
    const int r = level.modes(), n = level.width(), q = level.prescribed();
    const Matrix &displaced = level.displacement_acceleration(), &moving = level.velocity_acceleration();
    result.resize(n);
    for (int i = 0; i < r; ++i) {
        double total = std::abs(level.constant_acceleration()[i]) + level.omega()[i] * std::abs(state.velocity[i]);
        for (int j = 0; j < r; ++j) {
            total += std::abs(displaced(i, j)) * std::max(std::abs(state.displacement[j]), state.mapped_displacement[j]);
            total += std::abs(moving(i, j)) * std::max(std::abs(state.velocity[j]), state.mapped_velocity[j]);
        }
        for (int k = 0; k < q; ++k) {
            total += std::abs(displaced(i, r + k)) * inputs.value_sizes()[k];
            total += std::abs(moving(i, r + k)) * inputs.rate_sizes()[k];
        }
        result[i] = total;
    }
    for (int k = 0; k < n - r; ++k) result[r + k] = k < q ? inputs.acceleration_sizes()[k] : 0.0;
}

// ---------------------------------------------------------------------- transitions of states (eq. 38.6)

namespace {

// matrix x + offset and the size of its terms; coordinates that are zero have none.
void apply(const Matrix& matrix, const Vector* offset, const Vector& x, Vector& result, Vector& sizes) {
    Index moving = x.size();
    while (moving > 0 && x[moving - 1] == 0.0) --moving;  // a start at rest has no velocity at all
    sizes.resize(matrix.rows());
    for (Index i = 0; i < matrix.rows(); ++i) {
        double total = offset ? (*offset)[i] : 0.0;
        double size = std::abs(total);
        const double* row = matrix.data() + i * matrix.cols();
        for (Index j = 0; j < moving; ++j) {
            total += row[j] * x[j];
            size += std::abs(row[j]) * std::abs(x[j]);
        }
        result[i] = total;
        sizes[i] = size;
    }
}

// The sizes of the terms where a transition sets held displacements: it knows the terms of its own numbers.
void size_by_terms(const Matrix& terms, bool of_displacement, const Vector& x, Vector& sizes) {
    const Index n = terms.cols() - 1;
    for (Index i = 0; i < terms.rows(); ++i) {
        double size = of_displacement ? terms(i, n) : 0.0;  // the last column is that of displacements
        for (Index j = 0; j < n; ++j) size += std::abs(terms(i, j) * x[j]);
        sizes[i] = size;
    }
}

// Adds to the sizes of a transition's terms those of the scales of the state before.
void map_scales(const Matrix& matrix, const Vector& scale, const Vector& mapped, int modes, Vector& result) {
    for (int i = 0; i < modes; ++i) {
        const double* row = matrix.data() + i * matrix.cols();
        for (Index j = 0; j < matrix.cols(); ++j) result[i] += std::abs(row[j]) * std::max(scale[j], mapped[j]);
    }
}

}  // namespace

void Mover::move(const State& displaced, const Transition& by_displacement, const State& moving,
                 const Transition& by_velocity, const Inputs& inputs, State& result) {
    const Level& level = *by_displacement.target;
    const int r = level.modes();
    result.enter(level);
    apply(by_displacement.matrix, &by_displacement.offset, displaced.displacement, result.displacement,
          displacement_sizes_);
    apply(by_velocity.velocity_matrix, nullptr, moving.velocity, result.velocity, velocity_sizes_);
    if (by_displacement.terms)
        size_by_terms(*by_displacement.terms, true, displaced.displacement, displacement_sizes_);
    if (by_velocity.terms) size_by_terms(*by_velocity.terms, false, moving.velocity, velocity_sizes_);
    for (int i = r + level.prescribed(); i < level.width(); ++i)  // a held displacement of round-off is zero
        if (std::abs(result.displacement[i]) <= round_off::zero * displacement_sizes_[i]) result.displacement[i] = 0.0;
    measure(result, inputs);
    for (int i = 0; i < r; ++i) {
        result.mapped_displacement[i] = displacement_sizes_[i];
        result.mapped_velocity[i] = velocity_sizes_[i];
        if (by_velocity.terms) {  // it sets held displacements: its terms count in the following motion too
            result.displacement_scale[i] += displacement_sizes_[i];
            result.velocity_scale[i] += velocity_sizes_[i];
        }
    }
    // Modes are orthogonal to round-off alone: every coordinate has that of the largest one, far from an equilibrium.
    const Vector& before = displaced.displacement;
    const double largest = before.head(displaced.level->modes()).lpNorm<Eigen::Infinity>();
    result.mapped_displacement.head(r).array() += round_off::product / round_off::zero * largest;
    map_scales(by_displacement.matrix, displaced.displacement_scale, displaced.mapped_displacement, r,
               result.mapped_displacement);
    map_scales(by_velocity.velocity_matrix, moving.velocity_scale, moving.mapped_velocity, r, result.mapped_velocity);
}

double gap(const State& state, int link) {
    const LevelData& data = state.level->data();
    double value = data.gap_constants[link];
    for (Index i = 0; i < state.displacement.size(); ++i) value += data.gap_rows(link, i) * state.displacement[i];
    return value;
}

// ---------------------------------------------------------------------- signs of signals (sentence 9)

int signal_sign(const State& state, const Signal& signal, double further) {
    // The parts of a mode's displacement and of its velocity may cancel, as at the root of a damper's force, so each
    // counts by itself. At the root all displacements may be round-off of their earlier values: the scales count too.
    const Row& row = signal.row;
    round_off::Sum sum;
    sum.add(row.constant);
    sum.add_size(further);
    for (Index i = 0; i < row.displacement.size(); ++i) {
        sum.add(row.displacement[i] * state.displacement[i]);
        sum.add_size(std::abs(row.displacement[i]) * state.displacement_scale[i]);
        if (row.depends_on_velocity) {
            sum.add(row.velocity[i] * state.velocity[i]);
            sum.add_size(std::abs(row.velocity[i]) * state.velocity_scale[i]);
        }
    }
    return sum.sign();
}

int rate_sign(const State& state, const Signal& signal, const Inputs& inputs) {
    // At a turning point all velocities may be round-off of their earlier values, so their scales count, and the terms of
    // the transition that has made the state. Accelerations may cancel: their terms count.
    const Row& row = signal.row;
    static thread_local Vector acceleration, sizes;
    if (row.depends_on_velocity) {
        accelerate(state, inputs, acceleration);
        acceleration_sizes(state, inputs, sizes);
    }
    round_off::Sum sum;
    sum.add_size(mapped_rate_size(state, signal));
    for (Index i = 0; i < row.displacement.size(); ++i) {
        sum.add(row.displacement[i] * state.velocity[i]);
        sum.add_size(std::abs(row.displacement[i]) * state.velocity_scale[i]);
        if (row.depends_on_velocity) {
            sum.value += row.velocity[i] * acceleration[i];
            sum.add_size(std::abs(row.velocity[i]) * sizes[i]);
        }
    }
    return sum.sign();
}

double mapped_size(const State& state, const Signal& signal) {
    const Row& row = signal.row;
    const int r = state.level->modes();
    double size = 0.0;
    for (int i = 0; i < r; ++i) size += std::abs(row.displacement[i]) * state.mapped_displacement[i];
    for (int i = 0; i < (row.depends_on_velocity ? r : 0); ++i)
        size += std::abs(row.velocity[i]) * state.mapped_velocity[i];
    return size;
}

double mapped_rate_size(const State& state, const Signal& signal) {
    double size = 0.0;
    for (int i = 0; i < state.level->modes(); ++i)
        size += std::abs(signal.row.displacement[i]) * state.mapped_velocity[i];
    return size;
}

double held_part(const State& state, const Signal& signal) {
    double total = 0.0;
    for (int k = state.level->modes() + state.level->prescribed(); k < state.level->width(); ++k)
        total += signal.row.displacement[k] * state.displacement[k];
    return total;
}

double held_size(const State& state, const Signal& signal) {
    double total = 0.0;
    for (int k = state.level->modes() + state.level->prescribed(); k < state.level->width(); ++k)
        total += std::abs(signal.row.displacement[k] * state.displacement[k]);
    return total;
}

}  // namespace multiphi
