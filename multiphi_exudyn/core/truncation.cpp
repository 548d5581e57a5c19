#include "truncation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "defect_form.hpp"

namespace multiphi {

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
constexpr double energy_share = 0.01;  // of the largest energy of a run: below it truncation is not worth a warning

enum class Struck { none, stays_closed, reopens };

// Whether |y|^2 at the start shows that the indicator of a sum of defects is below a threshold: a defect has changed |y|
// there by no more than its size, and the start is the first sample, which counts by half.
bool is_small(double defects, double start_square, double threshold) {
    const double factor = 1.0 + std::sqrt(2.0 * MotionSize::samples) / threshold;
    return defects * factor * factor < start_square;
}

// Whether contacts that are struck at an instant stay closed.
Struck struck_at(const Instant& instant) {
    Struck result = Struck::none;
    for (const Change& change : instant.changes) {
        if (!(change.impulse > 0.0) || change.is_shared()) continue;
        if (instant.trial.level->state(change.element) == open_state) return Struck::reopens;
        result = Struck::stays_closed;
    }
    return result;
}

}  // namespace

void Defects::add(const Instant& instant) {
    if (levels_->model().is_complete) return;
    const State &before = instant.reached, &after = instant.trial;
    const Struck struck = struck_at(instant);
    const bool is_same_level = before.level == after.level;
    if (struck == Struck::none && is_same_level) return;
    if (struck == Struck::reopens) {
        int count = 0;
        double defect = nan;
        for (const Change& change : instant.changes)
            if (change.impulse > 0.0 && !change.is_shared()) {
                ++count;
                defect = change.impulse * change.impulse * after.level->struck_defects()[change.element];
            }
        sum += is_same_level && count == 1 ? defect : nan;
        return;
    }
    const Transition& transition = levels_->transition(*before.level, *after.level);
    const DefectForm& form = levels_->defect_form(transition);
    const int n = before.level->width(), r = after.level->width();
    if (!instant.is_mapped_again && !instant.velocities_changed) {
        sum += form.squares(before.displacement.data(), before.velocity.data(), n);
        return;
    }
    displaced_.resize(n + r);
    moved_.resize(n + r);
    displaced_.head(n) = before.displacement;
    moved_.head(n) = before.velocity;
    if (instant.is_mapped_again)
        displaced_.tail(r) = transition.matrix * before.displacement + transition.offset - after.displacement;
    else
        displaced_.tail(r).setZero();  // one transition has made the displacements
    moved_.tail(r) = transition.velocity_matrix * before.velocity - after.velocity;
    sum += form.squares(displaced_.data(), moved_.data(), n + r);
}

void Defects::add_start(const State& start, const State& after, const Instant& instant) {
    const Model& model = levels_->model();
    if (model.is_complete) return;
    const LevelData& data = after.level->data();
    const bool holds_rigidly = std::any_of(data.links.begin(), data.links.end(),
                                           [&](int link) { return model.base.constrains(link); });
    if (holds_rigidly || struck_at(instant) != Struck::none) {
        sum = nan;
        return;
    }
    const int m = model.base.modes(), r = after.level->modes(), q = after.level->channels();
    const Vector d = start.displacement.head(m) - data.configuration - data.shapes() * after.displacement.head(r) -
                     data.channel_shapes * after.displacement.tail(q);
    const Vector w = start.velocity.head(m) - data.modes * after.velocity.head(r) -
                     data.channel_shapes * after.velocity.tail(q);
    sum += d.squaredNorm() + model.base.periods.cwiseProduct(w).squaredNorm();
}

// ---------------------------------------------------------------------- size of the motion

void MotionSize::begin(double start, double end, double start_square) {
    first_ = start;
    end_ = end;
    start_square_ = start_square;
    mean_square_ = largest_energy_ = 0.0;
    count_ = 0;
}

void MotionSize::sample(Motion& motion, double segment_start, double segment_end, double defects, double last_decision,
                        bool is_isolated) {
    // Before the first decision the later truncation is unknown, so every segment is sampled but one that ends the run.
    // Where no load acts the energy is largest at the start, and is not sampled.
    int samples_here = 0;
    while (end_ > first_ && count_ < samples) {
        const bool is_last = count_ == samples - 1;
        const double t = is_last ? end_ : first_ + (end_ - first_) * count_ / (samples - 1);
        if (t > segment_end || (t == segment_end && !is_last)) return;
        if (is_small(defects, start_square_, motion_threshold) && (last_decision > first_ || segment_end >= end_)) {
            end_ = first_;  // sampling ends
            return;
        }
        const double weight = count_ > 0 && !is_last ? 1.0 : 0.5;
        if (samples_here > 0 && motion.basis().pure) {
            sampled_.enter(motion.level());
            motion.next_state((end_ - first_) / (samples - 1), samples_here > 1, sampled_.displacement, sampled_.velocity);
            add(weight, !is_isolated);
        } else {
            add_sample(motion, t - segment_start, weight, !is_isolated);
        }
        ++samples_here;
    }
}

void MotionSize::add_sample(Motion& motion, double delay, double weight, bool with_energy) {
    sampled_.enter(motion.level());
    motion.state_at(delay, sampled_.displacement, sampled_.velocity);
    add(weight, with_energy);
}

void MotionSize::add(double weight, bool with_energy) {
    const Level& level = *sampled_.level;
    const Matrix& factor = level.size_factor();
    const int n = level.width();
    double square = 0.0;
    for (int line = 0; line <= n; ++line) {
        double size = factor(line, n);
        for (int c = line; c < n; ++c) size += factor(line, c) * sampled_.displacement[c];
        square += size * size;
    }
    ++count_;
    mean_square_ += weight * square / (samples - 1);
    if (!with_energy) return;
    const Vector& work = level.static_work();
    double energy = total_energy(sampled_) + work[n];
    for (int c = 0; c < n; ++c) energy += work[c] * sampled_.displacement[c];
    largest_energy_ = std::max(largest_energy_, std::abs(energy));
}

// ---------------------------------------------------------------------- estimates

double lost_share(double lost, double largest) {
    if (lost <= energy_share * largest) return 0.0;
    return largest != 0.0 ? lost / largest : 1.0;  // truncation has removed all of it at the start
}

double indicator(double defects, double mean_square) {
    if (mean_square == 0.0) return defects != 0.0 ? infinity : 0.0;
    return std::sqrt(defects / mean_square);
}

void estimate_truncation(Truncation& truncation, const Ledger& ledger, double threshold) {
    const double lost = truncation.truncated_energy +
                        std::abs(ledger.at_start.truncation_kinetic + ledger.at_start.truncation_strain);
    const double start_energy = std::abs(ledger.start_energy + ledger.start_potential);
    truncation.energy_share = truncation.motion = 0.0;
    if (!(lost <= energy_share * start_energy)) {
        const double largest = truncation.is_isolated ? start_energy
                               : std::isnan(truncation.largest_energy)
                                   ? nan
                                   : std::max(start_energy, truncation.largest_energy);
        truncation.energy_share = lost_share(lost, largest);
    }
    const double defects = truncation.defects, square = truncation.mean_square;
    if (defects <= 0.0 || is_small(defects, truncation.start_square, threshold)) return;
    const double error = indicator(defects, square);
    truncation.motion = error <= threshold ? 0.0 : error;
}

bool is_balanced(const Ledger& ledger, double energy) {
    Loss lost = ledger.at_start;
    lost += ledger.at_events;
    const double damping = lost.damping + ledger.works.damping, friction = lost.friction + ledger.works.friction;
    const double work = lost.stop_work + ledger.works.varying + ledger.load_work;
    const double truncated = lost.truncation_kinetic + lost.truncation_strain;
    const double limit = open_ledger * (std::abs(ledger.start_energy) + std::abs(energy) + std::abs(work));
    const double left = ledger.start_energy + work - lost.impact - damping - friction - truncated - energy;
    const bool is_taken = lost.impact >= -limit && damping >= -limit && friction >= -limit;
    return is_taken && std::abs(left) <= limit;
}

}  // namespace multiphi
