// Redundant contacts and friction: only an independent set of links holds (sentences 2 and 12).
#include <algorithm>
#include <limits>

#include "law/law.hpp"
#include "orthonormal.hpp"

namespace multiphi {

// Keeps in `closing` contacts that are independent beside the links `held`, penetrating ones first; how many. Of redundant
// contacts an independent set carries all forces, of those that close together the roughest ones. Between two stops without
// clearance, an unloaded contact would otherwise keep the loaded one open.
int Law::keep_independent(Flags& closing, const std::vector<int>& held) {
    const int count = model_->size();
    union_.resize(count);
    for (int i = 0; i < count; ++i) union_[i] = std::max(held[i], static_cast<int>(closing[i]));
    if (are_independent(union_)) return static_cast<int>(std::count(closing.begin(), closing.end(), 1));
    union_ = held;
    Flags joined(count, 0);
    for (const bool penetrates : {true, false})
        for (const int i : model_->roughest_first) {
            if (!closing[i] || is_refused(instant.trial, i) != penetrates) continue;
            const int before = union_[i];
            union_[i] = 1;
            if (are_independent(union_))
                joined[i] = 1;
            else
                union_[i] = before;
        }
    closing = joined;
    return static_cast<int>(std::count(closing.begin(), closing.end(), 1));
}

// The links of an element that a state holds without a spring: 1 the first one, of a closed rigid contact, 2 that of friction
// which sticks, 3 both.
int Law::held_links(int element, int state) const {
    const Element& of = model_->elements[element];
    const int first = of.is_rigid() && state != open_state ? 1 : 0;
    return of.has_stick() && of.stick.spring == 0.0 && state == of.stick.state ? first + 2 : first;
}

// Whether friction sticks in the level with a key while the other links held prevent its slip anyway.
bool Law::is_redundant_stick(const Key& key, int element) {
    if (held_links(element, key[element]) < 2) return false;
    union_.resize(model_->size());
    for (int i = 0; i < model_->size(); ++i) union_[i] = held_links(i, key[i]);
    return !are_independent(union_);
}

// Removes requests to stick of friction elements whose slip the links that hold already prevent.
void Law::drop_redundant_stick(Requests& targets) {
    const Level& level = *instant.trial.level;
    union_.resize(model_->size());
    for (int i = 0; i < model_->size(); ++i) {
        const int held = held_links(i, level.state(i));
        union_[i] = targets[i] == no_request ? held : held % 2;
    }
    for (int i = 0; i < model_->size(); ++i) {
        const int held = targets[i] == no_request ? 0 : held_links(i, targets[i]), before = union_[i];
        if (held < 2) continue;
        union_[i] = held;
        if (are_independent(union_)) continue;
        union_[i] = before;
        const bool slips = level.state(i) > model_->elements[i].stick.state;
        targets[i] = slips ? no_request : state_without_stick(i, level.state(i));
    }
}

// Whether no direction of the links held depends on the others, so that all can be held together. held: 1 for the first link
// of an element, 2 for that of friction, 3 for both.
bool Law::are_independent(const std::vector<int>& held) {
    const Matrix& units = directions_.size() ? directions_ : model_->unit_directions;
    const int m = static_cast<int>(units.cols());
    int rank = 0;
    double smallest = std::numeric_limits<double>::infinity();
    for (int i = 0; i < model_->size(); ++i)
        for (const int part : {1, 2}) {
            if ((held[i] & part) == 0) continue;
            if (rank == m) return false;
            const int link = part == 1 ? i : model_->elements[i].stick.link;
            if (orthonormal_.size() < static_cast<std::size_t>((rank + 1) * m)) orthonormal_.resize((rank + 1) * m);
            double* direction = orthonormal_.data() + rank * m;
            for (int j = 0; j < m; ++j) direction[j] = units(link, j);
            for (int pass = 0; pass < 2; ++pass)
                for (int b = 0; b < rank; ++b) {
                    const double* other = orthonormal_.data() + b * m;
                    double product = 0.0;
                    for (int j = 0; j < m; ++j) product += other[j] * direction[j];
                    for (int j = 0; j < m; ++j) direction[j] -= product * other[j];
                }
            const double length = norm(direction, m);
            smallest = std::min(smallest, length);
            for (int j = 0; j < m; ++j) direction[j] /= length > 0.0 ? length : 1.0;
            ++rank;
        }
    return smallest > independence_;
}

// Whether friction transmits no impulse: it has no spring, and its normal force is no reaction (12).
bool Law::bears_no_impulse(int element) const {
    const Element& of = model_->elements[element];
    return of.has_stick() && of.stick.spring == 0.0 && !of.is_rigid();
}

// The state of a friction element that does not stick: idle at a contact that is not rigid, else slip in the direction of the
// state before, or forward if that is no slip (12).
int Law::state_without_stick(int element, int before) const {
    const Element& of = model_->elements[element];
    const bool gives_way = of.kind == Kind::compliant || of.kind == Kind::viscous;
    return gives_way ? of.stick.state + idle : std::max(before, of.stick.state + slip_forward);
}

}  // namespace multiphi
