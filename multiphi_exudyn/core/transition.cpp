#include "transition.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "round_off.hpp"

namespace multiphi {

namespace {

// Product of two modes, of unit length in either energy, below which they are orthogonal.
constexpr double unmixed = 1e-13;

// Psi_m^T Psi_l (r_m, r_l), zero where a product is round-off of its modes' lengths in both energies.
//
// Such a product would give a contact at rest, which no other mode moves, a velocity. The kinetic energy is a sum of
// eta'^2, the strain energy one of (omega eta)^2: there the length of T_ij is |T_ij| omega_i / omega_j, so a small
// share that a stiff mode has in a soft one may count. The modes' own round-off, larger if there are many, is not
// considered.
Matrix modal_projection(const Level& target, const Level& source) {
    Matrix products = target.data().modes.transpose() * source.data().shapes();
    for (Index i = 0; i < products.rows(); ++i) {
        for (Index j = 0; j < products.cols(); ++j) {
            const double own = std::abs(target.data().squares[i]), other = std::abs(source.data().squares[j]);
            const double share = own > other ? std::sqrt(other / own) : 1.0;
            if (std::abs(products(i, j)) <= std::max(round_off::product, unmixed * share)) products(i, j) = 0.0;
        }
    }
    return products;
}

// Additions to w = (rows xi_l + constants) where links begin to hold: the excess of q over the stretch it is to have.
struct NewlyHeld {
    Matrix rows;       // (q, n_l)
    Vector constants;  // (q,)
};

NewlyHeld newly_held(const Level& source, const Level& target) {
    const Model& model = source.model();
    NewlyHeld result{Matrix::Zero(source.channels(), source.width()), Vector::Zero(source.channels())};
    for (std::size_t k = 0; k < model.base.held.size(); ++k) {
        const int link = model.base.held[k], channel = source.prescribed() + static_cast<int>(k);
        for (int i = 0; i < model.size(); ++i) {
            const Element& element = model.elements[i];
            if (std::find(element.links.begin(), element.links.end(), link) == element.links.end()) continue;
            const std::vector<int>& before = element.states[source.state(i)].links;
            const std::vector<int>& after = element.states[target.state(i)].links;
            const bool begins = std::find(after.begin(), after.end(), link) != after.end() &&
                                std::find(before.begin(), before.end(), link) == before.end();
            if (!begins) continue;
            const Row stretch = source.stretch(i);
            result.rows.row(channel) = source.data().gap_rows.row(link) - stretch.displacement.transpose();
            result.constants[channel] = source.data().gap_constants[link] - stretch.constant;
        }
    }
    return result;
}

// [[projection, Psi_m^T (source - target)], [0, 1]]: channels keep their values.
Matrix map_beside_channels(const Matrix& projection, const Matrix& modes, const Matrix& source, const Matrix& target) {
    const Index r = projection.rows(), before = projection.cols(), q = source.cols();
    Matrix result = Matrix::Zero(r + q, before + q);
    result.topLeftCorner(r, before) = projection;
    result.topRightCorner(r, q) = modes.transpose() * (source - target);
    result.bottomRightCorner(q, q).setIdentity();
    return result;
}

// Sums of the absolute terms of T and c. They are larger than T and c where a slow part of a stiff mode cancels. That
// part is what a stiff link keeps of its stretch, and what the first accelerations of a slip consist of.
Matrix sizes_of_terms(const Level& source, const Level& target, const NewlyHeld& held) {
    const LevelData& before = source.data();
    const LevelData& after = target.data();
    const int r = source.modes(), q = source.channels(), n = source.width();
    Matrix moved(before.modes.rows(), n + 1);
    moved << before.shapes().cwiseAbs(), before.channel_shapes.cwiseAbs() + after.channel_shapes.cwiseAbs(),
        before.configuration.cwiseAbs() + after.configuration.cwiseAbs();
    Matrix set_by(q, n + 1);
    set_by << held.rows.cwiseAbs(), held.constants.cwiseAbs();
    Matrix result(target.width(), n + 1);
    result.topRows(target.modes()) =
        after.modes.cwiseAbs().transpose() * (moved + after.channel_shapes.cwiseAbs() * set_by);
    result.bottomRows(q) = set_by;
    result.bottomRows(q).middleCols(r, q).diagonal().array() += 1.0;
    return result;
}

}  // namespace

const GuardForm& return_guard(const ElementState& entered, int left) {
    for (const GuardForm& guard : entered.guards)
        if (guard.target == left) return guard;
    return entered.guards.front();
}

Transition::Transition(const Level& from, const Level& to) : source(&from), target(&to) {
    const LevelData& before = from.data();
    const LevelData& after = to.data();
    const int q = from.channels(), r = to.modes();
    if (from.is_base()) {
        const Matrix projection = after.modes.transpose();
        const Matrix none = Matrix::Zero(projection.cols(), q);
        matrix = map_beside_channels(projection, after.modes, none, after.channel_shapes);
        velocity_matrix = map_beside_channels(projection, after.modes, none, after.carried);
        offset.setZero(to.width());
        offset.head(r) = -(projection * after.configuration);
        Matrix shapes(projection.cols(), q + 1);
        shapes << after.channel_shapes, after.configuration;
        start_sizes = projection.cwiseAbs() * shapes.cwiseAbs();
        return;
    }
    const Matrix projection = modal_projection(to, from);
    const NewlyHeld held = newly_held(from, to);
    matrix = map_beside_channels(projection, after.modes, before.channel_shapes, after.channel_shapes);
    velocity_matrix = map_beside_channels(projection, after.modes, before.carried, after.carried);
    const Matrix shapes_in_modes = after.modes.transpose() * after.channel_shapes;
    matrix.topRows(r) -= shapes_in_modes * held.rows;
    matrix.bottomRows(q) += held.rows;
    const Vector jump = before.configuration - after.configuration - after.channel_shapes * held.constants;
    offset.resize(to.width());
    offset << after.modes.transpose() * jump, held.constants;
    if (q > from.prescribed()) terms = sizes_of_terms(from, to, held);
}

std::size_t Transition::bytes() const {
    const Index further = terms ? terms->size() : 0;
    const Index numbers = matrix.size() + velocity_matrix.size() + offset.size() + start_sizes.size() + further;
    return sizeof(Transition) + sizeof(double) * static_cast<std::size_t>(numbers);
}

Signal entered_signal(const Transition& transition, int element) {
    const Level& source = *transition.source;
    const Level& target = *transition.target;
    const ElementState& entered = source.model().elements[element].states[target.state(element)];
    const Row there = target.signal(return_guard(entered, source.state(element))).row;
    round_off::Sum constant;
    for (Index i = 0; i < there.displacement.size(); ++i) constant.add(there.displacement[i] * transition.offset[i]);
    constant.add(there.constant);
    Row row;
    row.displacement = transition.matrix.transpose() * there.displacement;
    const Vector sizes = transition.matrix.cwiseAbs().transpose() * there.displacement.cwiseAbs();
    for (Index i = 0; i < row.displacement.size(); ++i)
        if (std::abs(row.displacement[i]) <= round_off::zero * sizes[i]) row.displacement[i] = 0.0;
    row.velocity = transition.velocity_matrix.transpose() * there.velocity;
    row.constant = constant.sign() != 0 ? constant.value : 0.0;
    return source.signal_of(std::move(row));
}

}  // namespace multiphi
