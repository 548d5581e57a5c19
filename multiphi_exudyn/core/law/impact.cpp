#include "law/impact.hpp"

#include <algorithm>
#include <cmath>

#include "failure.hpp"
#include "orthonormal.hpp"
#include "round_off.hpp"

namespace multiphi {

namespace impact {

double velocity_size(const State& state, const double* row) {
    const int r = state.level->modes();
    double channels = 0.0;
    for (int k = r; k < state.level->width(); ++k) channels += std::abs(row[k]) * std::abs(state.velocity[k]);
    return norm(row, r) * norm(state.velocity.data(), r) + channels;
}

double negligible_velocity(const State& state, int contact, const double* row, const Vector& acceleration) {
    const LevelData& data = state.level->data();
    double size = std::abs(data.gap_constants[contact]), falling = 0.0;
    for (int i = 0; i < state.level->width(); ++i) {
        size += std::abs(data.gap_rows(contact, i)) * std::abs(state.displacement[i]);
        falling -= row[i] * acceleration[i];
    }
    const double height = std::max(round_off::zero * size, -gap(state, contact));
    return falling > 0.0 ? std::sqrt(2.0 * height * falling) : 0.0;
}

double resting_size(const Vector& one, const Vector& other, const double* row) {
    double total = 0.0;
    for (Index i = 0; i < one.size(); ++i) total += std::abs(row[i]) * std::max(one[i], other[i]);
    return total;
}

bool same_velocity(const State& before, const State& after) {
    const int r = before.level->modes();
    double changed = 0.0;
    for (int i = 0; i < r; ++i) {
        const double difference = after.velocity[i] - before.velocity[i];
        changed += difference * difference;
    }
    return std::sqrt(changed) <= resting * norm(before.velocity.data(), r);
}

}  // namespace impact

namespace {

// The sign of the velocity along a row after an impact, 0 if it is round-off; `released`: the state before it.
int slip_sign(const State& state, const State& released, const double* row) {
    const double velocity = scalar_product(row, state.velocity.data(), state.level->width());
    const double size = impact::velocity_size(state, row) + impact::velocity_size(released, row);
    if (std::abs(velocity) <= impact::resting * size) return 0;
    return velocity > 0.0 ? 1 : -1;
}

}  // namespace

Impact::Impact(const Model& model) : enters(model.size(), closed_state), model_(&model) {}

void Impact::fill_rows(const Level& level, const std::vector<int>& contacts, int held) {
    const int count = static_cast<int>(contacts.size()), n = level.width();
    problem.pose(count, level.modes(), level.channels());
    for (int k = 0; k < count; ++k) {
        const double sign = k < count - held ? 1.0 : -1.0;
        double* row = problem.rows[k];
        for (int i = 0; i < n; ++i) row[i] = sign * level.data().velocity_rows(contacts[k], i);
    }
}

int Impact::add_friction_rows(const State& state, const std::vector<int>& contacts, const State* released) {
    const Level& level = *state.level;
    const int n = level.width();
    bool is_separate = false;
    for (std::size_t k = 0; k < contacts.size(); ++k) {
        const Element& element = model_->elements[contacts[k]];
        enters[contacts[k]] = closed_state;
        if (element.static_friction == 0.0) continue;
        if (!is_separate) problem.separate_pushing_rows();
        is_separate = true;
        const double* tangential = level.data().velocity_rows.row(element.stick.link).data();
        const int slips = released ? slip_sign(state, *released, tangential) : 0;
        if (slips != 0) {
            enters[contacts[k]] = closed_state + (slips > 0 ? slip_forward : slip_backward);
            double* push = problem.pushing_rows[static_cast<int>(k)];
            for (int i = 0; i < n; ++i) push[i] -= slips * element.friction * tangential[i];
            continue;
        }
        const int row = problem.add_row();
        for (int i = 0; i < n; ++i) problem.rows[row][i] = problem.pushing_rows[row][i] = tangential[i];
        problem.leaders[row] = static_cast<int>(k);
        problem.ratios[row] = released ? element.static_friction : element.friction;
    }
    return problem.count();
}

void Impact::least_change(const Level& level, const std::vector<int>& contacts, const Vector& vector,
                          const std::vector<double>* sizes, const std::vector<double>* wanted,
                          const std::vector<double>* least) {
    const int r = level.modes(), n = level.width(), count = static_cast<int>(contacts.size());
    const int row_count = problem.count();
    for (int k = 0; k < row_count; ++k) {
        const double* row = problem.rows[k];
        round_off::Sum value;
        for (int i = 0; i < n; ++i) value.add(row[i] * vector[i]);
        for (int j = 0; j < (least ? count : 0); ++j)
            value.add((*least)[j] * scalar_product(row, problem.rows[j], r));
        double friction_bound = 0.0;
        if (least && k >= count) friction_bound = problem.ratios[k] * (*least)[problem.leaders[k]];
        problem.values[k] = wanted && k < count ? value.value - (*wanted)[k] : value.value;
        problem.sizes[k] = value.size + (sizes ? (*sizes)[k] : 0.0);
        problem.lower[k] = -friction_bound;
        problem.upper[k] = k < count ? std::numeric_limits<double>::infinity() : friction_bound;
    }
    if (level.mobility()) limit_rows(level, count);
    switch (problem.solve(SmallProblem::Order::most_violated)) {
        case SmallProblem::Outcome::solved:
            break;
        case SmallProblem::Outcome::excluded: {
            std::vector<int> elements;
            for (const int row : problem.excluding) elements.push_back(contacts[row < count ? row : problem.leaders[row]]);
            throw NumericalFailure(Cause::squeezed, elements);
        }
        case SmallProblem::Outcome::undecided:
            throw NumericalFailure(Cause::unsettled);
    }
    for (int j = 0; j < (least ? count : 0); ++j) {
        problem.multipliers[j] += (*least)[j];
        for (int i = 0; i < r; ++i) problem.change[i] += (*least)[j] * problem.rows[j][i];
    }
    if (level.mobility()) limit_change(level);
}

// Replaces rows (count, r) by rows F; a contact that cannot move for attached bodies has no condition.
void Impact::limit_rows(const Level& level, int count) {
    const int r = level.modes();
    const Matrix& root = *level.mobility();
    memory_.resize(r);
    for (int k = 0; k < count; ++k) {
        double* row = problem.rows[k];
        const double length = norm(row, r);
        for (int j = 0; j < r; ++j) {
            memory_[j] = 0.0;
            for (int i = 0; i < r; ++i) memory_[j] += row[i] * root(i, j);
        }
        const double limited = norm(memory_.data(), r);
        const bool is_held = limited * limited <= impact::immovable * length * length;
        for (int j = 0; j < r; ++j) row[j] = is_held ? 0.0 : memory_[j];
        if (is_held) problem.values[k] = 0.0;
    }
}

// Replaces the change z (r,) by F z.
void Impact::limit_change(const Level& level) {
    const int r = level.modes();
    const Matrix& root = *level.mobility();
    memory_.assign(problem.change.begin(), problem.change.end());
    for (int i = 0; i < r; ++i) {
        problem.change[i] = 0.0;
        for (int j = 0; j < r; ++j) problem.change[i] += root(i, j) * memory_[j];
    }
}

void Impact::collide(const State& state, const std::vector<int>& contacts, int held, const std::vector<double>* wanted,
                     const std::vector<double>* least, const Inputs& inputs, State& result,
                     std::vector<double>& impulses, Loss& loss) {
    // Velocities that the impact has reduced to round-off are set to zero, as the contact would bounce and rock with them
    // until they underflow. So are displacements that are round-off, as they would swing and strike again.
    const Level& level = *state.level;
    const int r = level.modes(), n = level.width(), count = static_cast<int>(contacts.size());
    fill_rows(level, contacts, held);
    const int rows = held == 0 ? add_friction_rows(state, contacts, nullptr) : count;
    least_change(level, contacts, state.velocity, nullptr, wanted, least);
    impulses = problem.multipliers;
    std::vector<double>& values = problem.values;
    double plastic = 0.0;
    for (int k = 0; k < (least ? rows : 0); ++k) values[k] = scalar_product(problem.rows[k], state.velocity.data(), n);
    for (int k = 0; k < (least ? 0 : count); ++k) {
        plastic -= 0.5 * impulses[k] * values[k];
        if (wanted) plastic -= impulses[k] * (*wanted)[k];
    }
    result = state;
    for (int i = 0; i < r; ++i) result.velocity[i] += problem.change[i];
    for (int k = least ? 0 : count; k < rows; ++k) {
        const double after = scalar_product(problem.rows[k], result.velocity.data(), n);
        plastic -= 0.5 * impulses[k] * (values[k] + after);
    }
    const bool stopped = norm(result.velocity.data(), r) <= impact::resting * norm(state.velocity.data(), r);
    for (int i = 0; i < r; ++i) {
        if (!stopped && !(std::abs(result.velocity[i]) <= impact::resting * std::abs(state.velocity[i]))) continue;
        result.velocity[i] = 0.0;
        if (std::abs(result.displacement[i]) <= round_off::zero * state.displacement_scale[i])
            result.displacement[i] = 0.0;
    }
    measure(result, inputs);
    const double lost = kinetic_energy(state) - kinetic_energy(result);
    if (level.channels() == 0) plastic = lost;
    loss.impact += plastic;
    loss.stop_work += plastic - lost;
}

}  // namespace multiphi
