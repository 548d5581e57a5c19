#include "run.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <utility>

#include "failure.hpp"

namespace multiphi {

namespace {

constexpr double accumulated = 1e-6;           // of the time so far: a window of decisions within it is chatter
constexpr std::size_t most_level_bytes = 1ull << 29, between_checks = 256;  // of the levels; segments between checks
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

}  // namespace

// ---------------------------------------------------------------------- chatter

void Chatter::begin(double time) {
    decisions_ = 0;
    last_decision_ = time;
    ring_.assign(window_ + 1, {});
}

void Chatter::add(double time, double highest_frequency, bool is_rebound_only) {
    ring_[decisions_ % (window_ + 1)] = {last_decision_, highest_frequency};
    last_decision_ = time;
    if (!is_rebound_only) ++decisions_;  // a sequence of bounces ends by itself
}

bool Chatter::is_chatter(double time, double& elapsed, double& highest_frequency) const {
    if (decisions_ <= window_) return false;
    const int size = window_ + 1;
    const double limit = window_ / allowed_;
    elapsed = time - ring_[(decisions_ - window_) % size].time_before;
    const double last_frequency = ring_[(decisions_ - 1) % size].highest_frequency;
    if (elapsed > accumulated * time && last_frequency * elapsed >= limit) return false;
    highest_frequency = 0.0;
    for (int k = 0; k < size; ++k)
        if (k != (decisions_ - window_ - 1) % size)
            highest_frequency = std::max(highest_frequency, ring_[k].highest_frequency);
    const double periods = highest_frequency * elapsed;
    return elapsed <= accumulated * time || (0.0 < periods && periods < limit);
}

// ---------------------------------------------------------------------- run

Run::Run(std::shared_ptr<Levels> levels, Chatter chatter, double time)
    : levels_(std::move(levels)),
      trajectory_(std::make_shared<Trajectory>()),
      inputs_(levels_->excitation()),
      law_(*levels_, inputs_, chatter_.exchanges),
      chatter_(std::move(chatter)),
      defects_(*levels_),
      time_(time) {
    chatter_.begin(time);
    chatter_.exchanges.begin(levels_->model().size());
    trajectory_->instants.push_back(time);
}

void Run::begin(Start start) {
    start_ = std::move(start);
    has_started_ = goes_on_ = false;
}

void Run::go_on_from(const FinalState& state, bool loads_differ) {
    const Level& level = levels_->level(state.key);
    if (levels_->excitation().prescribed > 0)
        inputs_.set(state.interval, state.age, time_, levels_->excitation().intervals.end(state.interval));
    current_.enter(level);
    current_.displacement = state.displacement;
    current_.velocity = state.velocity;
    current_.phases = state.phases;
    current_.all_armed =
        std::all_of(state.phases.begin(), state.phases.end(), [](Phase phase) { return phase == Phase::armed; });
    measure(current_, inputs_);
    hold_again();
    has_started_ = !loads_differ;
    goes_on_ = true;
    defects_.sum = loads_differ ? 0.0 : nan;
}

// Contacts that another run has held open are held for a period.
void Run::hold_again() {
    const Level& level = *current_.level;
    if (!(level.highest_frequency() > 0.0)) return;
    for (std::size_t k = 0; k < current_.phases.size(); ++k) {
        const int element = level.guards()[k].element;
        if (current_.phases[k] == Phase::held_back && levels_->model().elements[element].is_rigid() &&
            level.state(element) == open_state)
            chatter_.exchanges.hold(element, time_ + 1.0 / level.highest_frequency());
    }
}

void Run::begin_step(double time, const StepState& state) {
    time_ = time;
    trajectory_ = std::make_shared<Trajectory>();
    trajectory_->instants.push_back(time);
    const Level& level = levels_->level(state.key);
    const int r = level.modes(), q = level.prescribed(), held = level.channels() - q;
    if (q > 0) {
        const Intervals& intervals = levels_->excitation().intervals;
        const int interval = intervals.at(time);
        inputs_.set(interval, time - intervals.start(interval), time, intervals.end(interval));
    }
    current_.enter(level);
    current_.displacement << state.displacement.head(r) - level.centre(), inputs_.values(),
        state.displacement.tail(held);
    current_.velocity << state.velocity.head(r), inputs_.rates(), state.velocity.tail(held);
    current_.phases = state.phases;
    current_.all_armed =
        std::all_of(state.phases.begin(), state.phases.end(), [](Phase phase) { return phase == Phase::armed; });
    measure(current_, inputs_);
    law_.instant.first_change = 0;
    work_ = 0.0;
    has_started_ = true;
    goes_on_ = false;
}

StepState Run::step_state(const State& state) const {
    const Level& level = *state.level;
    const int r = level.modes(), held = level.channels() - level.prescribed();
    StepState result{level.key(), Vector(r + held), Vector(r + held), state.phases};
    result.displacement << state.displacement.head(r) + level.centre(), state.displacement.tail(held);
    result.velocity << state.velocity.head(r), state.velocity.tail(held);
    return result;
}

FinalState Run::final_state() const {
    return {time_, current_.level->key(), current_.displacement, current_.velocity, current_.phases, inputs_.interval(),
            inputs_.age()};
}

Run::Ending Run::advance(double end, bool stop_at_event) {
    try {
        const Ending ending = run_segments(end, stop_at_event);
        finish();
        return ending;
    } catch (...) {
        finish();
        throw;
    }
}

// The energies and the truncation estimate at the present end.
void Run::finish() {
    Ledger& ledger = trajectory_->ledger;
    ledger.load_work = work_;
    ledger.end_energy = nan;
    ledger.is_balanced = false;
    if (has_started_ && keeps_summary_) {
        ledger.end_energy = kinetic_energy(current_) + strain_energy(current_);
        ledger.is_balanced = is_balanced(ledger, total_energy(current_));
    }
    trajectory_->evaluations = search_.evaluations();
    if (levels_->model().is_complete || !keeps_summary_) return;
    Truncation& truncation = trajectory_->truncation;
    truncation.defects = defects_.sum;
    truncation.start_square = motion_size_.start_square();
    truncation.is_isolated = levels_->excitation().is_isolated;
    const bool is_sampled = motion_size_.is_complete(time_);
    truncation.mean_square = is_sampled ? motion_size_.mean_square() : nan;
    truncation.largest_energy = is_sampled ? motion_size_.largest_energy() : nan;
    estimate_truncation(truncation, ledger, motion_threshold);
}

Run::Ending Run::run_segments(double end, bool stop_at_event) {
    if (!has_started_) {
        if (goes_on_)
            continue_run();
        else
            begin_run();
        motion_size_.begin(time_, end, goes_on_ ? 0.0 : square_of_start());
    }
    while (time_ < end) {
        const std::size_t events_before = trajectory_->events.size();
        if (inputs_.count() > 0 && time_ >= inputs_.interval_end()) begin_next_interval(end);
        advance_segment(inputs_.count() > 0 ? std::min(end, inputs_.interval_end()) : end);
        if (trajectory_->bytes() > most_bytes_)
            throw NumericalFailure(Cause::record_full, {},
                                   {static_cast<double>(trajectory_->bytes()),
                                    static_cast<double>(trajectory_->segments.size()), static_cast<double>(most_bytes_)});
        bound_levels();
        if (stop_at_event && trajectory_->events.size() > events_before) return Ending::event;
    }
    if (!current_.displacement.allFinite()) throw NumericalFailure(Cause::not_finite);  // a growing mode that no guard watches
    return Ending::end_reached;
}

// Forgets the levels but the present one where they fill the memory.
void Run::bound_levels() {
    if (shares_levels_ || trajectory_->segments.size() < segments_checked_ + between_checks) return;
    segments_checked_ = trajectory_->segments.size();
    if (levels_->bytes() < most_level_bytes) return;
    levels_->forget_but(*current_.level);
    trajectory_->forget_addresses();
}

double Run::square_of_start() const {
    const State& start = law_.start();
    return start.displacement.head(levels_->base().modes()).squaredNorm();
}

// Makes the first state of the run the current one, with the events of the start.
void Run::begin_run() {
    if (inputs_.count() > 0) inputs_.set(0, 0.0, time_, levels_->excitation().intervals.end(0));
    law_.instant.time = time_;
    law_.begin(start_);
    has_started_ = true;
    Ledger& ledger = trajectory_->ledger;
    if (law_.instant.changes.empty()) ledger.at_start = law_.instant.loss;  // losses that no event records
    work_ = load_work(law_.instant.trial) - load_work(law_.start());
    ledger.start_energy = total_energy(law_.start()) + start_.spring_energy;
    ledger.start_potential = levels_->excitation().static_load.dot(start_.displacement);
    current_ = law_.instant.trial;
    defects_.add_start(law_.start(), current_, law_.instant);
    trajectory_->transitions += law_.instant.transitions;
    keep_events();
}

// Begins at the final state of another run: where the loads differ from those before, elements may change their states at
// once.
void Run::continue_run() {
    trajectory_->ledger.start_energy = total_energy(current_);
    law_.instant.time = time_;
    law_.instant.reached = current_;
    const bool is_event = law_.decide_jump();
    has_started_ = true;
    if (!is_event) return;
    current_ = law_.instant.trial;
    defects_.sum = nan;
    trajectory_->transitions += law_.instant.transitions;
    keep_events();
}

// Begins the next interval of the channels in the present state: where a load jumps, elements may change their states.
void Run::begin_next_interval(double end) {
    const double before = total_energy(current_);
    const Level& level = *current_.level;
    const int r = level.modes();
    inputs_.set(inputs_.interval() + 1, 0.0, time_, std::min(end, levels_->excitation().intervals.end(inputs_.interval() + 1)));
    State& reached = law_.instant.reached;
    reached = current_;
    for (int k = 0; k < inputs_.count(); ++k) {
        reached.displacement[r + k] = inputs_.values()[k];
        const double jump = reached.velocity[r + k] - inputs_.rates()[k];
        reached.velocity[r + k] -= jump;
        for (int i = 0; i < (level.carried().size() > 0 ? r : 0); ++i)
            reached.velocity[i] += level.carried()(k, i) * jump;
    }
    measure(reached, inputs_);
    law_.instant.time = time_;
    bool is_event = false;
    std::exception_ptr failure;
    try {
        is_event = law_.decide_jump();
    } catch (...) {
        failure = std::current_exception();
    }
    const State& after = is_event ? law_.instant.trial : reached;
    work_ += kinetic_energy(reached) + potential_energy(reached) - before + load_work(after);
    current_ = after;
    if (failure) std::rethrow_exception(failure);
    if (!is_event) return;
    if (keeps_summary_) defects_.add(law_.instant);
    trajectory_->transitions += law_.instant.transitions;
    keep_events();
}

// Advances within one level to the next decision, to where a contact is no more held open, or to `end` [s]. Guards are armed on the way: the state reached has their
// phases, and becomes the state of the instant.
void Run::advance_segment(double end) {
    const Level& level = *current_.level;
    law_.instant.time = time_;
    end = std::min(end, law_.next_release());
    const double start_time = time_, horizon = end - start_time;
    const State& start = current_;
    State& reached = law_.instant.reached;
    if (inputs_.count() > 0) inputs_.advance(0.0, start_time, end);
    const double unit = inputs_.horizon();
    motion_.begin(start, inputs_);
    reached = start;
    double elapsed = 0.0, armed_after = 0.0;
    bool is_decision_due = false;
    while (!is_decision_due) {
        law_.watch(motion_, reached.phases, signals_, watched_);
        const Descent descent = search_.first(motion_.basis(), signals_, elapsed, horizon);
        if (descent.outcome == Descent::Outcome::none) {
            elapsed = horizon;
            break;
        }
        if (descent.outcome != Descent::Outcome::found)
            throw NumericalFailure(descent.outcome == Descent::Outcome::too_long ? Cause::search_too_long
                                                                                 : Cause::not_finite,
                                   {}, {motion_.basis().fastest, descent.details[0], descent.details[1]});
        elapsed = descent.time;
        is_decision_due = law_.collect_requests(motion_, signals_, watched_, descent.signal, elapsed);
        if (!is_decision_due) {
            Law::arm(reached, watched_[descent.signal].guard);
            armed_after = elapsed;
        }
    }
    const double instant_time = elapsed == horizon ? end : start_time + elapsed;
    law_.instant.time = instant_time;
    if (elapsed > 0.0)  // at the start the state is exact, its terms would add round-off
        motion_.state_at(elapsed, reached.displacement, reached.velocity);
    terms_before_ = inputs_.terms();
    const double age = inputs_.age();
    if (inputs_.count() > 0) inputs_.advance(elapsed, instant_time, end);
    measure(reached, inputs_);
    if (elapsed > 0.0) motion_.raise_scales(reached);
    works_ = Works();
    const bool is_summed = sums_works_ && work_sums_.add_segment(start, reached, terms_before_, inputs_.terms(), elapsed,
                                                                 works_);
    const double fastest = motion_.basis().fastest;
    const bool is_at_once = elapsed <= (fastest > 0.0 ? instant / fastest : 0.0);
    if (is_at_once) keep_scales(reached, start);
    if (!is_decision_due) is_decision_due = law_.release_held(start_time);
    if (keeps_summary_)
        motion_size_.sample(motion_, start_time, instant_time, defects_.sum, chatter_.last_decision(),
                            levels_->excitation().is_isolated);
    std::exception_ptr failure;
    if (is_decision_due) {
        law_.flag_repeated_requests(is_at_once);
        try {
            law_.decide();
        } catch (...) {
            failure = std::current_exception();
        }
    }
    keep_segment(instant_time, age, armed_after, unit, is_summed);
    if (!is_decision_due) {
        current_ = reached;
        return;
    }
    chatter_.add(time_, level.highest_frequency(), !failure && law_.is_rebound_only());
    if (failure) {
        current_ = reached;
        std::rethrow_exception(failure);
    }
    trajectory_->transitions += law_.instant.transitions;
    if (inputs_.count() > 0) work_ += load_work(law_.instant.trial) - load_work(reached);
    current_ = law_.instant.trial;
    if (keeps_summary_) defects_.add(law_.instant);
    keep_events();
    double elapsed_in_window = 0.0, highest_frequency = 0.0;
    if (chatter_.is_chatter(time_, elapsed_in_window, highest_frequency))
        throw NumericalFailure(Cause::chatter, {}, {elapsed_in_window, highest_frequency});
}

// Records the segment from the current state to an instant, which becomes the present time.
void Run::keep_segment(double instant_time, double age, double armed_after, double horizon, bool is_summed) {
    Trajectory& kept = *trajectory_;
    Segment segment;
    segment.level = kept.level_number(*current_.level);
    segment.interval = inputs_.interval();
    segment.age = age;
    segment.horizon = horizon;
    segment.entry_work = work_;
    segment.coordinates = kept.coordinates.size();
    kept.coordinates.insert(kept.coordinates.end(), current_.displacement.begin(), current_.displacement.end());
    kept.coordinates.insert(kept.coordinates.end(), current_.velocity.begin(), current_.velocity.end());
    if (!current_.all_armed) {
        segment.armed_after = armed_after;
        segment.phases = static_cast<std::ptrdiff_t>(kept.phases.size());
        kept.phases.insert(kept.phases.end(), current_.phases.begin(), current_.phases.end());
    }
    if (is_summed) {
        works_.varying += work_;
        kept.ledger.works += works_;
    } else {
        kept.left_out.push_back(static_cast<int>(kept.segments.size()));
    }
    kept.segments.push_back(segment);
    kept.instants.push_back(instant_time);
    time_ = instant_time;
    work_ = 0.0;
}

// Records the changes of a decision as events; the first one that is not shared has the energy lost at the whole instant.
void Run::keep_events() {
    bool is_first = true;
    for (const Change& change : law_.instant.changes) {
        Event event{time_, change, {}};
        if (is_first && !change.is_shared()) {
            is_first = false;
            event.loss = law_.instant.loss;
            trajectory_->ledger.at_events += event.loss;
            trajectory_->truncation.truncated_energy +=
                std::abs(event.loss.truncation_kinetic + event.loss.truncation_strain);
        }
        trajectory_->events.push_back(event);
    }
}

}  // namespace multiphi
