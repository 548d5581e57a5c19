#include "held_forces.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "decompositions.hpp"

namespace multiphi {

namespace {

// What direct reactions (k,) of the links that act add to a guard's signal.
double share_of(const GuardForm& form, const std::vector<int>& links, const Vector& reactions) {
    double total = 0.0;
    for (const Share& share : form.shares) {
        if (share.force == 0.0) continue;
        const auto place = std::find(links.begin(), links.end(), share.link) - links.begin();
        total += share.force * reactions[place];
    }
    return total;
}

// Sets the constants of rows (k, n + 1), their last column, to those of the plain ones about the centre d (r,).
void shift(const Matrix& plain, const Vector& d, Matrix& rows) {
    const Index last = plain.cols() - 1;
    if (plain.rows() > 0) rows.col(last) = plain.col(last) + plain.leftCols(d.size()) * d;
}

}  // namespace

Compliance::Compliance(const LevelData& level) {
    const Index r = level.squares.size();
    std::vector<Index> elastic;
    for (Index i = 0; i < r; ++i)
        if (level.squares[i] != 0.0) elastic.push_back(i);
    Matrix stiffness = level.coupling(elastic, elastic);
    for (std::size_t k = 0; k < elastic.size(); ++k) stiffness(k, k) += level.squares[elastic[k]];
    inverse.setZero(r, r);
    if (!elastic.empty()) inverse(elastic, elastic) = multiphi::inverse(stiffness);
    if (static_cast<Index>(elastic.size()) == r) return;
    free_share = Matrix::Identity(r, r) - level.coupling * inverse;
    for (const Index i : elastic) free_share.row(i).setZero();
}

void Level::hold(const Level& plain, const Compliance& compliance, const HeldForce& force) {
    const auto modal = force.modal.head(modes_);
    centre_ = compliance.inverse * modal;
    const Vector& d = centre_;
    const LevelData& own = plain.data_;
    data_.gap_constants = own.gap_constants + own.gap_rows.leftCols(modes_) * d;
    data_.forces = own.forces + own.force_rows.leftCols(modes_) * d + force.reactions;
    data_.configuration = own.configuration + own.modes * d;
    if (compliance.free_share.size() > 0) {
        const Vector free_force = compliance.free_share * modal;
        data_.drive = own.drive + free_force;
        constant_acceleration_ = plain.constant_acceleration_ + free_force;
        drives_free_modes_ = plain.drives_free_modes_ || (free_force.array() != 0.0).any();
    }
    const PotentialForm& potential = plain.potential_;
    potential_.constant =
        potential.constant + potential.linear.head(modes_).dot(d) + 0.5 * potential.squares.dot(d.cwiseAbs2());
    potential_.linear.head(modes_) = potential.linear.head(modes_) + potential.squares.cwiseProduct(d);
    potential_.linear.tail(channels_) = potential.linear.tail(channels_) + potential.rows.leftCols(modes_) * d;
    data_.strain = potential_.constant - data_.stored + excitation_->static_load.dot(data_.configuration);
    shift(potential.follows, d, potential_.follows);
    shift(plain.patterns_, d, patterns_);
    std::size_t k = 0;
    for (int i = 0; i < model_->size(); ++i)
        for (const GuardForm& form : model_->elements[i].states[data_.key[i]].guards) {
            const Row& row = plain.guards_[k].signal.row;
            guards_[k++].signal.row.constant =
                row.constant + row.displacement.head(modes_).dot(d) + share_of(form, data_.links, force.reactions);
        }
    renew_derived();
}

void HeldLevels::set_forces(Forces forces, std::optional<AttachedInertia> inertia) {
    forces_ = std::move(forces);
    inertia_ = std::move(inertia);
    ++set_;
}

const Level& HeldLevels::level(const Key& key) { return held(key).level; }

const HeldLevels::HeldLevel& HeldLevels::held(const Key& key) {
    auto found = levels_.find(key);
    if (found == levels_.end()) {
        const Level& plain = Levels::level(key);
        auto made = std::make_unique<HeldLevel>(HeldLevel{&plain, Compliance(plain.data()), plain, {}, -1});
        found = levels_.emplace(key, std::move(made)).first;
    }
    HeldLevel& kept = *found->second;
    if (kept.set == set_) return kept;
    kept.force = forces_(key);
    kept.level.hold(*kept.plain, kept.compliance, kept.force);
    const std::vector<Element>& elements = model().elements;
    const bool any_rigid =
        std::any_of(elements.begin(), elements.end(), [](const Element& element) { return element.is_rigid(); });
    kept.level.set_mobility(inertia_ && any_rigid ? std::optional(inertia_->mobility(key)) : std::nullopt);
    kept.set = set_;
    return kept;
}

const Level& HeldLevels::plain(const Level& level) { return level.is_base() ? level : *levels_.at(level.key())->plain; }

const Transition& HeldLevels::transition(const Level& source, const Level& target) {
    const std::pair<const Level*, const Level*> way{&source, &target};
    auto found = transitions_.find(way);
    if (found == transitions_.end()) {
        const Transition& plain = Levels::transition(this->plain(source), this->plain(target));
        auto made = std::make_unique<HeldTransition>(HeldTransition{&plain, plain, -1});
        made->transition.source = &source;
        made->transition.target = &target;
        found = transitions_.emplace(way, std::move(made)).first;
    }
    HeldTransition& kept = *found->second;
    Transition& transition = kept.transition;
    if (kept.set == set_) return transition;
    const Transition& plain = *kept.plain;
    const int before = source.modes(), after = target.modes();
    transition.offset = plain.offset + plain.matrix.leftCols(before) * source.centre();
    transition.offset.head(after) -= target.centre();
    transition.velocity_matrix = plain.velocity_matrix;
    if (inertia_)
        transition.velocity_matrix.topLeftCorner(after, before) = inertia_->velocity_map(
            source.key(), target.key(), plain.velocity_matrix.topLeftCorner(after, before));
    kept.set = set_;
    return transition;
}

const Signal& HeldLevels::entered_signal(const Level& level, int guard) {
    const std::pair<const Level*, int> place{&level, guard};
    auto found = entered_.find(place);
    if (found == entered_.end()) {
        const Signal& plain = Levels::entered_signal(this->plain(level), guard);
        found = entered_.emplace(place, std::make_unique<HeldSignal>(HeldSignal{&plain, plain, -1})).first;
    }
    HeldSignal& kept = *found->second;
    if (kept.set == set_) return kept.signal;
    const int element = level.guards()[guard].element;
    const HeldLevel& entered = held(entered_key(level, guard));
    const GuardForm& back = return_guard(model().elements[element].states[entered.level.state(element)],
                                         level.state(element));
    const Row& row = kept.plain->row;
    kept.signal.row.constant = row.constant + row.displacement.head(level.modes()).dot(level.centre()) +
                                share_of(back, entered.level.data().links, entered.force.reactions);
    kept.set = set_;
    return kept.signal;
}

std::size_t HeldLevels::bytes() const {
    std::size_t total = Levels::bytes();
    for (const auto& [key, kept] : levels_)
        total += kept->level.bytes() + sizeof(double) * static_cast<std::size_t>(kept->compliance.inverse.size());
    for (const auto& [way, kept] : transitions_) total += kept->transition.bytes();
    for (const auto& [place, kept] : entered_) total += kept->signal.bytes();
    return total;
}

void HeldLevels::forget() {
    entered_.clear();
    transitions_.clear();
    levels_.clear();
    Levels::forget();
}

}  // namespace multiphi
