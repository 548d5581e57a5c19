// Rebounds: rigid contacts with restitution leave their stops after an impact, and the last bounce of a sequence
// (sentences 10 and 11).
//
//     H v+ + E H v- >= 0,  p >= 0, complementary;  wanted = -E H v-                                            (Moreau)
//
// It changes the kinetic energy by p (1 - E) H v-/2. E = diag(e) of the contacts that are struck, H v- < 0. A touching
// contact that leaves its stop, H v- > 0, has the largest of its own e and of theirs, e_s: then p (1 - E) H v- is at most
// (1 - e_s) p H v-, and that is not positive.
//
// Beside friction that would generate energy if the direction of slip turns (T. R. Kane). There all contacts are struck
// without restitution first, with impulses p, and then once more with at least e p (Poisson), H v+ >= 0, both times within
// the cone of friction.
//
// A sequence of bounces with e < 1, or with e = 1 beside friction that takes as much, s the speed at which the present one
// begins and a the acceleration of the gap back to the stop, takes another 2 s / (a (1 - e)): as long as one bounce of speed
// s / (1 - e).
#include <algorithm>
#include <cmath>

#include "failure.hpp"
#include "law/law.hpp"
#include "orthonormal.hpp"
#include "round_off.hpp"

namespace multiphi {

namespace {

constexpr int most_impacts = 10'000;  // at one instant, of contacts that drive each other back; 2750 take all at two e of .99
constexpr double brief = 1e-12;       // relative to the time so far: a shorter bounce is the last

}  // namespace

// Flags in `treated` all rigid contacts that take part in an impact because they touch, or move into their stop: if a contact
// that strikes has restitution; if any contact has friction all that touch, as one impact of all then differs from impacts
// in turn.
void Law::flag_touching(const Requests& requests) {
    const State& trial = instant.trial;
    const Level& level = *trial.level;
    bool any_strikes = false, any_rebounds = false, any_friction = false;
    for (int i = 0; i < model_->size(); ++i) {
        const Element& element = model_->elements[i];
        if (element.static_friction > 0.0) any_friction = true;
        if (!element.is_rigid() || level.state(i) != open_state || requests[i] == no_request) continue;
        any_strikes = true;
        if (element.restitution > 0.0) any_rebounds = true;
    }
    if (!any_strikes || !(any_rebounds || any_friction)) return;
    for (int i = 0; i < model_->size(); ++i) {
        const Element& element = model_->elements[i];
        if (level.state(i) != open_state || !element.is_rigid() || instant.treated[i]) continue;
        const Signal& gap_signal = level.guards()[level.first_guard(i)].signal;
        int rate = 0;
        if (any_rebounds || element.restitution > 0.0) rate = rate_sign(trial, gap_signal, *inputs_);
        instant.treated[i] = rate <= 0 && signal_sign(trial, gap_signal) == 0;
    }
}

// The gap velocity of a touching contact, zero if it is round-off; the rows of the impact are those of the contacts.
double Law::gap_velocity(const State& state, int touching) const {
    const double* row = impact_.row(touching);
    const double velocity = scalar_product(row, state.velocity.data(), state.level->width());
    return std::abs(velocity) <= impact::resting * impact::velocity_size(state, row) ? 0.0 : velocity;
}

// Sets `wanted_`: gap velocities of the touching contacts after an impact, from a state before it. Whether any of them is
// to leave its stop.
bool Law::set_rebound_velocities(const State& state) {
    impact_.fill_rows(*state.level, touching_);
    wanted_.assign(touching_.size(), 0.0);
    bool any = false;
    for (std::size_t k = 0; k < touching_.size(); ++k) {
        const int contact = touching_[k];
        const double restitution = is_on_last_bounce(contact) ? 0.0 : model_->elements[contact].restitution;
        const double velocity = restitution == 0.0 ? 0.0 : gap_velocity(state, static_cast<int>(k));
        wanted_[k] = velocity != 0.0 ? -restitution * velocity : 0.0;
        if (wanted_[k] > 0.0) any = true;
    }
    if (!any) return false;
    find_coupled(*state.level);
    check_restitutions(state);
    lend_restitutions(state);
    return true;
}

// Sets `groups_`: equal numbers of touching contacts that impulses couple.
void Law::find_coupled(const Level& level) {
    const int count = static_cast<int>(touching_.size()), r = level.modes();
    groups_.resize(count);
    for (int k = 0; k < count; ++k) groups_[k] = k;
    for (int k = 0; k < count; ++k)
        for (int j = 0; j < k; ++j) {
            const double *one = impact_.row(k), *other = impact_.row(j);
            const double coupling = std::abs(scalar_product(one, other, r));
            if (!level.mobility() && !(coupling > round_off::independent * norm(one, r) * norm(other, r))) continue;
            const int joined = groups_[k], group = groups_[j];
            std::replace(groups_.begin(), groups_.end(), joined, group);
        }
}

// Fails if coupled contacts that are struck together have different restitutions.
void Law::check_restitutions(const State& state) {
    std::vector<int> mixed;
    for (int k = 0; k < static_cast<int>(touching_.size()); ++k) {
        if (!(gap_velocity(state, k) < 0.0)) continue;
        for (int j = 0; j < k; ++j) {
            const int one = touching_[k], other = touching_[j];
            const bool is_same = model_->elements[one].restitution == model_->elements[other].restitution;
            const bool is_last = is_on_last_bounce(one) || is_on_last_bounce(other);
            if (is_same || is_last || groups_[k] != groups_[j] || !(gap_velocity(state, j) < 0.0)) continue;
            mixed.push_back(one);
            mixed.push_back(other);
        }
    }
    if (!mixed.empty()) throw NumericalFailure(Cause::mixed_restitution, mixed);
}

// Lets contacts that leave their stops have at least the e of those that are struck and coupled with them: with a smaller
// one they would gain more energy than the others lose.
void Law::lend_restitutions(const State& state) {
    for (int k = 0; k < static_cast<int>(touching_.size()); ++k) {
        const double velocity = gap_velocity(state, k);
        if (!(velocity > 0.0)) continue;
        for (int j = 0; j < static_cast<int>(touching_.size()); ++j) {
            const double struck = gap_velocity(state, j);
            if (struck < 0.0 && groups_[k] == groups_[j])
                wanted_[k] = std::min(wanted_[k], wanted_[j] / struck * velocity);
        }
    }
}

// The state after an impact with restitution, its impulses and losses. If any touching contact has friction, restitution is
// that of impulses (Poisson), else that of velocities (Moreau).
void Law::collide_and_rebound(const State& state, bool rebounds, State& result, Loss& loss) {
    bool any_friction = false;
    for (const int contact : touching_)
        if (rebounds && model_->elements[contact].static_friction > 0.0) any_friction = true;
    if (!any_friction) {
        impact_.collide(state, touching_, 0, rebounds ? &wanted_ : nullptr, nullptr, *inputs_, result, impulses_, loss);
        return;
    }
    const double loss_before = loss.impact;
    std::vector<double> compression;
    impact_.collide(state, touching_, 0, nullptr, nullptr, *inputs_, compressed_, compression, loss);
    const double loss_in_compression = loss.impact - loss_before;
    for (std::size_t k = 0; k < touching_.size(); ++k) {
        const int contact = touching_[k];
        const double restitution = is_on_last_bounce(contact) ? 0.0 : model_->elements[contact].restitution;
        compression[k] = std::max(compression[k], 0.0);
        wanted_[k] = restitution * compression[k];  // the least impulse of the second impact
    }
    impact_.collide(compressed_, touching_, 0, nullptr, &wanted_, *inputs_, result, impulses_, loss);
    for (std::size_t k = 0; k < touching_.size(); ++k) impulses_[k] += compression[k];
    if (!(loss.impact - loss_before >= -impact::resting * (loss_in_compression + kinetic_energy(state))))
        throw NumericalFailure(Cause::gaining_energy, touching_);
}

// Repeats impacts on a struck state until no contact is driven back to its stop by the others. Between two stops that both
// touch it, a mass loses its velocity in blows without end: what is round-off of the velocity before them is zero.
void Law::repeat_impacts(State& struck, Loss& loss) {
    const int r = struck.level->modes();
    const double first = norm(struck.velocity.data(), r);
    for (int repeated = 0; repeated < most_impacts; ++repeated) {
        bool any_approaches = false;
        if (norm(struck.velocity.data(), r) <= impact::resting * first) {
            struck.velocity.head(r).setZero();
            measure(struck, *inputs_);
        }
        impact_.fill_rows(*struck.level, touching_);
        for (int k = 0; k < static_cast<int>(touching_.size()); ++k)
            if (gap_velocity(struck, k) < 0.0) any_approaches = true;
        if (!any_approaches) return;
        set_rebound_velocities(struck);
        apply_further_impact(struck, loss);
    }
    throw NumericalFailure(Cause::unsettled);
}

// Replaces a struck state by the one after one more impact, with the gap velocities `wanted_`.
void Law::apply_further_impact(State& struck, Loss& loss) {
    impact_.collide(struck, touching_, 0, &wanted_, nullptr, *inputs_, compressed_, further_impulses_, loss);
    struck = compressed_;
    for (std::size_t k = 0; k < touching_.size(); ++k) impulses_[k] += further_impulses_[k];
}

// Whether an open contact comes to the instant on its last bounce: whatever other elements do first at that instant, it is
// to stay closed.
bool Law::is_on_last_bounce(int element) const {
    const State& reached = instant.reached;
    if (!reached.level || reached.level->state(element) != open_state) return false;
    return reached.phases[reached.level->first_guard(element)] == Phase::landing;
}

// Whether a contact has been struck and leaves its stop. Of those of one direction only some bear the impulse of all.
bool Law::has_rebounded(int touching) const {
    const int contact = touching_[touching];
    if (!(model_->elements[contact].restitution > 0.0) || is_on_last_bounce(contact)) return false;
    const Matrix& rows = struck_.level->data().velocity_rows;
    for (std::size_t k = 0; k < touching_.size(); ++k) {
        const auto own = rows.row(contact), other = rows.row(touching_[k]);
        const bool is_alike = own.dot(other) >= (1.0 - round_off::independent) * own.norm() * other.norm();
        if (is_alike && impulses_[k] > 0.0) return true;
    }
    return false;
}

// The share of its velocity with which a struck contact leaves its stop: e, or less where friction takes a part at e = 1.
double Law::returned_share(int touching, double velocity) const {
    const double restitution = model_->elements[touching_[touching]].restitution;
    const double arriving = -gap_velocity(released_, touching);
    return restitution < 1.0 || !(arriving > 0.0) ? restitution : velocity / arriving;
}

// Begins the last bounce of contacts whose next bounce is too low or too short; how many. `acceleration_`: xi'' of
// `struck_`. The last bounce takes as long as all bounces that would follow.
int Law::begin_last_bounces() {
    impact_.fill_rows(*struck_.level, touching_);
    int last = 0;
    for (int k = 0; k < static_cast<int>(touching_.size()); ++k) {
        const int contact = touching_[k];
        const double* row = impact_.row(k);
        const double velocity = gap_velocity(struck_, k), restitution = returned_share(k, velocity);
        const bool may_end = has_rebounded(k) && restitution < 1.0 && !instant.begins_last_bounce[contact];
        wanted_[k] = 0.0;
        const double falling = -scalar_product(row, acceleration_.data(), struck_.level->width());
        const double negligible = std::max(impact::negligible_velocity(struck_, contact, row, acceleration_),
                                           0.5 * brief * instant.time * falling);
        if (!may_end || !(0.0 < velocity && velocity <= negligible)) continue;
        wanted_[k] = velocity / (1.0 - restitution);
        instant.begins_last_bounce[contact] = 1;
        ++last;
    }
    if (last > 0) apply_further_impact(struck_, impact_loss_);
    return last;
}

bool Law::is_rebound_only() const {
    for (const Change& change : instant.changes) {
        const double restitution = model_->elements[change.element].restitution;
        if (!(0.0 < restitution && restitution < 1.0)) return false;
    }
    return !instant.changes.empty() && instant.reached.level == instant.trial.level;
}

// Sets phases of the trial state for contacts on their last bounce, begun now, or before without an impact since. A contact
// that has been struck was at its stop: its guard is armed if its gap is within the round-off of the instant at its speed.
void Law::mark_last_bounces() {
    State& trial = instant.trial;
    const Level& level = *trial.level;
    for (int i = 0; i < model_->size(); ++i) {
        if (!model_->elements[i].is_rigid() || level.state(i) != open_state) continue;
        bool is_struck = false;
        for (std::size_t k = instant.first_change; k < instant.changes.size(); ++k)
            if (instant.changes[k].element == i && instant.changes[k].impulse != 0.0) is_struck = true;
        Phase& phase = trial.phases[level.first_guard(i)];
        const double velocity =
            scalar_product(level.data().velocity_rows.row(i).data(), trial.velocity.data(), level.width());
        const double round_off = round_off::zero * instant.time * velocity;
        if (is_struck && phase == Phase::recovering && -gap(trial, i) <= round_off) phase = Phase::armed;
        const bool is_last = instant.begins_last_bounce[i] || (!is_struck && is_on_last_bounce(i));
        if (is_last && phase == Phase::armed) phase = Phase::landing;
    }
    trial.all_armed = std::all_of(trial.phases.begin(), trial.phases.end(),
                                  [](Phase phase) { return phase == Phase::armed; });
}

}  // namespace multiphi
