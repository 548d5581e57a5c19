#include "power_forms.hpp"

#include <algorithm>
#include <cmath>

#include "level.hpp"

namespace multiphi {

namespace {

// Constant forces (l,) [N] of the elements along the directions of their first links.
Vector constant_forces(const Level& level) {
    const Model& model = level.model();
    Vector result = Vector::Zero(model.base.links());
    for (int i = 0; i < model.size(); ++i) {
        const Element& element = model.elements[i];
        result[element.links.front()] = element.states[level.state(i)].force;
    }
    return result;
}

// The friction of an element whose force is a multiple of the force of a link.
LinkFriction link_friction(const Level& level, const Element& element, const FrictionRatio& friction) {
    const LevelData& data = level.data();
    const auto place = std::find(data.links.begin(), data.links.end(), friction.link) - data.links.begin();
    const int held = element.stick.link;
    return {friction.ratio * data.force_rows.row(place).transpose(),
            friction.ratio * data.force_velocity_rows.row(place).transpose(), friction.ratio * data.forces[place],
            data.velocity_rows.row(held).transpose(), data.gap_rows.row(held).transpose()};
}

// The powers of the channels: of patterns, and of the forces on moving stops and on what these carry with them.
void add_channel_powers(const Level& level, const Vector& pushes, PowerForms& forms) {
    const Base& base = level.model().base;
    const Excitation& excitation = level.excitation();
    const LevelData& data = level.data();
    const int n = level.width(), q = level.channels();
    const std::vector<int>& links = data.links;
    const Matrix& carried = data.carried;
    Matrix shapes(base.modes(), n), moved(base.modes(), n);
    shapes << data.shapes(), data.channel_shapes;
    moved << data.modes, carried;
    const Vector static_load = excitation.static_load + base.preload;
    // work of unit forces of links on w'
    const Matrix stops = carried.transpose() * base.force_directions.transpose() - excitation.stops.transpose();
    forms.on_value = excitation.patterns.transpose() * shapes;
    forms.on_displacement = carried.transpose() * base.squares.asDiagonal() * shapes;
    forms.on_displacement.rightCols(q) -= carried.transpose() * excitation.patterns;
    forms.on_velocity = carried.transpose() * base.damping * moved;
    forms.on_acceleration = carried.transpose() * moved;
    forms.constant = carried.transpose() * (base.squares.cwiseProduct(data.configuration) - static_load);
    forms.constant -= stops * pushes;
    forms.damping = moved.transpose() * base.damping * moved;
    for (std::size_t k = 0; k < links.size(); ++k) {
        const int link = links[k];
        const Index place = static_cast<Index>(k);
        const Vector on_stops = stops.col(link);
        if (std::isfinite(base.stiffnesses[link])) {
            forms.on_displacement += base.stiffnesses[link] * on_stops * data.gap_rows.row(link);
            forms.constant += base.stiffnesses[link] * data.gap_constants[link] * on_stops;
        } else if (!base.constrains(link) ||
                   std::find(base.oblique.begin(), base.oblique.end(), link) != base.oblique.end()) {
            forms.on_displacement -= on_stops * data.force_rows.row(place);
            forms.on_velocity -= on_stops * data.force_velocity_rows.row(place);
            forms.constant -= data.forces[place] * on_stops;
        }
        if (base.dampings[link] == 0.0) continue;
        forms.on_velocity += base.dampings[link] * on_stops * data.velocity_rows.row(link);
        forms.damping += base.dampings[link] * data.velocity_rows.row(link).transpose() * data.velocity_rows.row(link);
    }
    forms.damping.topLeftCorner(level.modes(), level.modes()) = data.damping;  // with the damping ratios given
}

}  // namespace

PowerForms power_forms(const Level& level) {
    const Model& model = level.model();
    const Vector pushes = constant_forces(level);
    const int n = level.width(), q = level.channels();
    PowerForms forms;
    forms.damping = level.data().damping;
    for (Matrix* part : {&forms.on_value, &forms.on_displacement, &forms.on_velocity, &forms.on_acceleration})
        part->setZero(q, n);
    forms.constant.setZero(q);
    if (q > 0) {
        add_channel_powers(level, pushes, forms);
        for (int i = 0; i < model.size(); ++i) {
            const Element& element = model.elements[i];
            const std::optional<FrictionRatio>& ratio = element.states[level.state(i)].ratio;
            if (!ratio) continue;
            forms.link_friction.push_back(link_friction(level, element, *ratio));
            const LinkFriction& added = forms.link_friction.back();
            const Vector moves = level.excitation().stops.row(element.stick.link).transpose();
            forms.on_displacement -= moves * added.displacement.transpose();
            forms.on_velocity -= moves * added.velocity.transpose();
            forms.constant -= added.constant * moves;
        }
    }
    forms.damping = ((forms.damping + forms.damping.transpose()) / 2).eval();
    const Vector friction = -(level.data().gap_rows.transpose() * pushes);
    if ((friction.array() != 0.0).any() || !forms.link_friction.empty()) forms.friction = friction;
    return forms;
}

}  // namespace multiphi
