#include "energy.hpp"

namespace multiphi {

Loss& Loss::operator+=(const Loss& other) {
    impact += other.impact;
    truncation_kinetic += other.truncation_kinetic;
    truncation_strain += other.truncation_strain;
    stop_work += other.stop_work;
    damping += other.damping;
    friction += other.friction;
    return *this;
}

double kinetic_energy(const State& state) {
    const Level& level = *state.level;
    const Vector& v = state.velocity;
    const int r = level.modes(), q = level.channels();
    const Matrix& carried = level.carried();
    double total = 0.0;
    for (int i = 0; i < r; ++i) total += 0.5 * v[i] * v[i];
    for (Index k = 0; k < carried.rows(); ++k) {
        for (int i = 0; i < r; ++i) total += carried(k, i) * v[i] * v[r + k];
        for (int j = 0; j < q; ++j) total += 0.5 * carried(k, r + j) * v[r + j] * v[r + k];
    }
    return total;
}

double potential_energy(const State& state) {
    const Level& level = *state.level;
    const PotentialForm& form = level.potential();
    const Vector& x = state.displacement;
    const int r = level.modes(), q = level.channels(), n = level.width();
    double total = form.constant;
    for (int i = 0; i < n; ++i) total += form.linear[i] * x[i];
    for (int i = 0; i < r; ++i) total += 0.5 * form.squares[i] * x[i] * x[i];
    for (int k = 0; k < q; ++k) {
        for (int i = 0; i < r; ++i) total += form.rows(k, i) * x[i] * x[r + k];
        for (int j = 0; j < q; ++j) total += 0.5 * form.rows(k, r + j) * x[r + j] * x[r + k];
    }
    for (Index k = 0; k < form.follows.rows(); ++k) {
        double stretch = form.follows(k, n);
        for (int i = 0; i < n; ++i) stretch += form.follows(k, i) * x[i];
        total += 0.5 * stretch * stretch;
    }
    return total;
}

double load_work(const State& state) {
    const Level& level = *state.level;
    const Matrix& patterns = level.patterns();
    const Vector& x = state.displacement;
    const int r = level.modes(), n = level.width();
    double total = 0.0;
    for (int k = 0; k < level.channels(); ++k) {
        double value = patterns(k, n);
        for (int i = 0; i < n; ++i) value += patterns(k, i) * x[i];
        total += value * x[r + k];
    }
    return total;
}

double total_energy(const State& state) { return kinetic_energy(state) + potential_energy(state) + load_work(state); }

double strain_energy(const State& state) {
    const StrainForm& form = state.level->strain();
    const Vector& x = state.displacement;
    const int n = state.level->width();
    double total = 0.0;
    for (Index k = 0; k < form.weights.size(); ++k) {
        double stretch = form.offsets[k];
        for (int i = 0; i < n; ++i) stretch += form.rows(k, i) * x[i];
        total += 0.5 * form.weights[k] * stretch * stretch;
    }
    for (int i = 0; i < n; ++i) total += form.linear[i] * x[i];
    return total + form.constant;
}

namespace {

// Energy [J] of the springs that act in a state of an element, at the gap of another state.
double stored_by(const State& state, const Element& element, int acting) {
    double total = 0.0;
    for (const int link : element.states[acting].links) {
        const double depth = gap(state, link);
        total += 0.5 * state.level->model().base.stiffnesses[link] * depth * depth;
    }
    return total;
}

}  // namespace

void add_losses(const State& before, const Key& key_before, const State& after, double collided, Loss& loss) {
    const Model& model = before.level->model();
    double relaxed = 0.0, dropped = 0.0;
    for (int i = 0; i < model.size(); ++i) {
        const Element& element = model.elements[i];
        const int left = key_before[i], entered = after.level->state(i);
        const bool was_open = left == open_state, is_open = entered == open_state;
        if (element.kind == Kind::viscous && was_open != is_open) {
            const double depth = gap(before, i), stored = 0.5 * element.stiffness * depth * depth;
            relaxed += is_open ? stored : -stored;
        }
        if (element.kind == Kind::bounded && !was_open && !is_open)
            relaxed += stored_by(before, element, left) - stored_by(before, element, entered);
        if (element.has_stick() && left == element.stick.state && entered != element.stick.state) {
            const double stretch = gap(before, element.stick.link);
            dropped += 0.5 * element.stick.spring * stretch * stretch * element.stick.drop;
        }
    }
    loss.truncation_kinetic += kinetic_energy(before) - kinetic_energy(after) - collided;
    loss.truncation_strain += potential_energy(before) - potential_energy(after) - relaxed - dropped;
    loss.damping += relaxed;
    loss.friction += dropped;
}

}  // namespace multiphi
