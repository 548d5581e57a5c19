#include "coupled_step.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "energy.hpp"
#include "failure.hpp"
#include "law/impact.hpp"
#include "round_off.hpp"
#include "symmetric_eigenpairs.hpp"

namespace multiphi {

namespace {

constexpr double solver_residual = 1e-9;  // of the accelerations: a smaller modal force is left by Newton's iterations
constexpr double unresolved = 0.1;        // of the largest energy at an event: error of the work of a constant force
constexpr double drift = 1e-3;            // of its terms: a gap that is more negative is not due to drift
constexpr std::size_t most_bytes = std::size_t{1} << 29;  // of all levels under held forces: more are made anew

std::vector<int> complement(Index count, std::vector<int> indices) {
    std::vector<int> others;
    std::sort(indices.begin(), indices.end());
    for (int i = 0; i < count; ++i)
        if (!std::binary_search(indices.begin(), indices.end(), i)) others.push_back(i);
    return others;
}

// Forgets the forces of a step when it ends, however it does.
struct ForcesOfStep {
    HeldLevels& levels;
    ~ForcesOfStep() { levels.set_forces({}, std::nullopt); }
};

}  // namespace

CoupledStep::CoupledStep(std::shared_ptr<HeldLevels> levels, Chatter chatter, double time, SolverPlaces places,
                         BodyKind kind, Matrix in_base)
    : levels_(std::move(levels)), run_(levels_, std::move(chatter), time), places_(std::move(places)), kind_(kind),
      in_base_(std::move(in_base)) {
    run_.sum_works(false);
    run_.keep_summary(false);  // a body does not report them
    const Model& model = levels_->model();
    for (int i = 0; i < model.base.links(); ++i) {
        if (!std::isinf(model.base.stiffnesses[i])) continue;
        rigid_.push_back(i);
        const std::vector<int>& held = model.base.held;
        if (std::find(held.begin(), held.end(), i) == held.end()) impact_links_.push_back(i);
    }
    is_any_rigid_ = std::any_of(model.elements.begin(), model.elements.end(),
                                [](const Element& element) { return element.is_rigid(); });
    free_ = complement(places_.constraints, places_.ties);
}

std::vector<Event> CoupledStep::take_events() { return std::exchange(events_, {}); }

const SolverLevel& CoupledStep::level(const Key& key) {
    auto found = known_.find(key);
    if (found == known_.end()) found = known_.emplace(key, system_->level(key)).first;
    return found->second;
}

std::vector<int> CoupledStep::closed_rigid(const Key& key) {
    std::vector<int> closed;
    for (const int link : plain(key).data().links)
        if (std::isinf(levels_->model().base.stiffnesses[link])) closed.push_back(link);
    return closed;
}

// ---------------------------------------------------------------------- state of the solver

Vector CoupledStep::own_state() const {
    Vector x(3 * size_);
    x << own(places_.displacement), own(places_.velocity), own(places_.acceleration);
    return x;
}

Vector CoupledStep::point_forces() const {
    return Vector::Map(places_.multipliers, places_.constraints)(places_.ties);
}

void CoupledStep::set_level(const Key& key, const Vector& held, const Vector& force) {
    if (key == key_ && (held.array() == held_.array()).all()) return;
    key_ = key;
    held_ = held;
    system_->set_level(key, held, force);
}

// Writes q, q', q'' of eta, eta' in a level, and the coordinates of the points that they give.
void CoupledStep::write(const Key& key, const Vector& held, const Vector& displacement, const Vector& velocity,
                        const Vector& modal_force) {
    const SolverLevel& written = level(key);
    const Index r = plain(key).modes(), s = size_;
    Vector modal = Vector::Zero(3 * s);
    modal.head(r) = displacement.head(r);
    modal.segment(s, r) = velocity.head(r);
    modal.tail(s) = modal_force + written.drive;
    const Vector rates = written.rates * modal;
    q().segment(places_.first, s) = modal.head(s);
    v().segment(places_.first, s) = rates.head(s);
    a().segment(places_.first, s) = rates.tail(s);
    if (!kind_.has_points) return;
    q()(places_.points) = written.rows * modal.head(s) + written.offset + written.held_offset * held;
    v()(places_.points) = written.rows * rates.head(s);
    a()(places_.points) = written.rows * rates.tail(s);
}

// Writes a state at the end of a step, with the acceleration under its force.
void CoupledStep::write_end(const StepState& state, const PointForce& force, double time) {
    const Vector own = own_force(state.key, time), held = state.displacement.tail(held_.size());
    set_level(state.key, held, level(state.key).drive + own);
    write(state.key, held, state.displacement, state.velocity, force.modal + own);
}

void CoupledStep::move_parts(const AttachedParts& parts, const Vector& displacement, const Vector& velocity) {
    const Vector moved = displacement + parts.follower * (q() - displacement)(places_.points);
    const Vector rate = velocity + parts.follower * (v() - velocity)(places_.points);
    q()(others_) = moved(others_);
    v()(others_) = rate(others_);
}

// ---------------------------------------------------------------------- forces

Vector CoupledStep::own_force(const Key& key, double time) {
    return kind_.has_varying_loads ? system_->own_force(key, time) : Vector::Zero(size_);
}

// External forces of a state (q, q', q''), by the equation of motion of the level whose matrices the system has.
PointForce CoupledStep::external(const Vector& x, const Vector& points) {
    const SolverLevel& present = level(key_);
    return {present.equation * x - present.drive, points};
}

// External forces in the present state, read from the system's; written: the level whose coordinates are in it.
CoupledStep::Evaluated CoupledStep::external_forces(const Key& written) {
    Evaluated result{{}, system_->forces()};
    const Vector x = own_state();
    const SolverLevel& present = level(key_);
    result.force.modal = result.system.segment(places_.first, size_) +
                         present.equation.leftCols(2 * size_) * x.head(2 * size_) - present.drive;
    result.force.points = result.system(places_.points);
    if (kind_.has_points) result.force.modal += level(written).rows.transpose() * result.force.points;
    return result;
}

// The same from the accelerations of the whole system, those of attached masses and constraints included.
CoupledStep::Evaluated CoupledStep::from_accelerations() {
    Evaluated result{{}, accelerations()};
    Vector x = own_state();
    x.tail(size_) = result.system.segment(places_.first, size_);
    result.force = external(x, point_forces());
    return result;
}

// Accelerations (n,) in the present state; writes the multipliers, and the accelerations of the other parts.
Vector CoupledStep::accelerations() {
    const Matrix mass = system_->mass(), jacobian = system_->jacobian();
    const Vector forces = system_->forces();
    const bool only_ties = jacobian.rows() <= static_cast<Index>(places_.ties.size());
    const Vector solution = solve_constrained(
        mass, jacobian, forces, only_ties ? Vector::Zero(jacobian.rows()) : system_->constraint_accelerations());
    Vector::Map(places_.multipliers, places_.constraints) = solution.tail(places_.constraints);
    a()(others_) = solution(others_);
    return solution.head(places_.coordinates);
}

// Corrects the other coordinates, coupled to the body by forces alone, for a jump (n,) of forces at an event.
void CoupledStep::apply_force_jump(const AttachedParts& parts, double elapsed, const Vector& jump) {
    if (others_.empty()) return;
    const Index count = static_cast<Index>(others_.size());
    const Matrix mass = parts.mass(others_, others_), jacobian = parts.jacobian(Eigen::all, others_);
    const Vector none = Vector::Zero(jacobian.rows()), jumps = jump(others_);
    if ((jumps.array() != 0.0).any())
        v()(others_) += elapsed * solve_constrained(mass, jacobian, jumps, none).head(count);
    const Vector prescribed = free_.empty() ? none : Vector(system_->constraint_accelerations()(free_));
    const Vector forces = system_->forces()(others_), solution = solve_constrained(mass, jacobian, forces, prescribed);
    a()(others_) = solution.head(count);
    Vector::Map(places_.multipliers, places_.constraints)(free_) = solution.tail(jacobian.rows());
}

void CoupledStep::clear_solver_residual(PointForce& force, const Vector& acceleration) const {
    if (force.modal.norm() <= solver_residual * acceleration.norm()) force.modal.setZero();
}

// ---------------------------------------------------------------------- surroundings

std::shared_ptr<const AttachedParts> CoupledStep::attached_parts(const Surroundings& around, double ago) {
    const Vector present = q();
    if (ago != 0.0) q()(others_) = (around.displacement - ago * around.velocity)(others_);  // joints had other angles
    Matrix mass = system_->mass(), jacobian(0, places_.coordinates);
    if (!free_.empty()) jacobian = system_->jacobian()(free_, Eigen::all);
    q() = present;
    auto parts = std::make_shared<const AttachedParts>(std::move(mass), std::move(jacobian), places_.first,
                                                       level(key_).mass(), places_.points);
    system_->check_attached(parts->connected);
    return parts;
}

std::shared_ptr<const PointInertia> CoupledStep::inertia_of(const AttachedParts& parts) {
    if (parts.only_forces) return nullptr;
    return std::make_shared<const PointInertia>(parts.inertia, parts.free, in_base_);
}

CoupledStep::Surroundings CoupledStep::surroundings(const Vector& x_end) {
    Surroundings around;
    if (!kind_.has_points) return around;
    around.displacement = q();
    around.velocity = v();
    around.parts = attached_parts(around, 0.0);
    around.inertia = inertia_of(*around.parts);
    if (!around.inertia || !kind_.depends_on_later_forces()) return around;
    const Index s = size_, r = plain(key_).modes(), h = held_.size();
    const Vector physical = level(key_).physical * x_end;
    StepState state{key_, Vector(r + h), Vector::Zero(r + h), {}};
    state.displacement << physical.head(r), held_;
    state.velocity.head(r) = physical.segment(s, r);
    around.reactions = reactions_of(around.inertia, state, physical.segment(2 * s, r), point_forces());
    return around;
}

// The reactions that follow from a state, of the accelerations eta'' (r,), with f on the points.
CoupledStep::Reactions CoupledStep::reactions_of(const std::shared_ptr<const PointInertia>& inertia,
                                                 const StepState& state, const Vector& acceleration,
                                                 const Vector& points) {
    const LevelData& data = plain(state.key).data();
    const Base& base = levels_->model().base;
    const Vector link_forces = data.forces + level(state.key).reactions * points +
                               data.force_rows * state.displacement + data.force_velocity_rows * state.velocity;
    const Vector stiffnesses = base.stiffnesses.unaryExpr([](double k) { return std::isinf(k) ? 0.0 : k; });
    Reactions result{inertia, data.modes * acceleration,
                     -stiffnesses.cwiseProduct(data.gap_rows * state.displacement + data.gap_constants) -
                         base.dampings.cwiseProduct(data.gap_rows * state.velocity)};
    Vector forces = push_of(result, state.key);
    for (std::size_t k = 0; k < data.links.size(); ++k)
        if (std::isinf(base.stiffnesses[data.links[k]]))
            forces += base.directions.row(data.links[k]).transpose() * link_forces[static_cast<Index>(k)];
    result.acceleration -= inertia->responses(forces);
    return result;
}

// Pushes (b,) of elements in a level: constant forces, and friction in proportion to pressures.
Vector CoupledStep::push_of(const Reactions& reactions, const Key& key) {
    const SolverLevel& in = level(key);
    Vector push = in.push;
    for (std::size_t e = 0; e < in.rubbing.size(); ++e)
        push += in.rubbing_forces.col(static_cast<Index>(e)) * reactions.pressures[in.rubbing[e]];
    return push;
}

// Forces (m,) on the points in a level, relative to a level without closed rigid links and without pushes.
Vector CoupledStep::caused(const Reactions& reactions, const Key& key) {
    const PointInertia& inertia = *reactions.inertia;
    const Vector push = push_of(reactions, key);
    Vector result = inertia.reactions(push);
    const std::vector<int> closed = closed_rigid(key);
    if (closed.empty()) return result;
    const Matrix directions = levels_->model().base.directions(closed, Eigen::all).transpose();
    const Vector lengths = directions.colwise().norm(), acceleration = reactions.acceleration + inertia.responses(push);
    const Matrix products = directions.transpose() * inertia.responses(directions);
    const Symmetric pairs = symmetric_eigenpairs(products.cwiseQuotient(lengths * lengths.transpose()));
    Vector forces = Vector::Zero(lengths.size());
    for (Index k = 0; k < pairs.values.size(); ++k) {  // of what can move
        if (pairs.values[k] <= impact::immovable) continue;
        const Vector mode = pairs.vectors.col(k).cwiseQuotient(lengths);
        forces += mode * (mode.dot(directions.transpose() * acceleration) / pairs.values[k]);
    }
    return result - inertia.reactions(directions) * forces;
}

// Only with one acceleration for both decisions do stick and slip exclude each other.
void CoupledStep::set_reactions_at(Surroundings& around, const StepState& state, const PointForce& force) {
    if (!around.inertia || !kind_.has_friction) return;
    const LevelData& data = plain(state.key).data();
    const Index r = data.squares.size();
    const auto eta = state.displacement.head(r), rate = state.velocity.head(r);
    const Vector acceleration = data.static_drive + force.modal.head(r) - data.damping_matrix * rate -
                                data.squares.cwiseProduct(eta) - data.coupling * eta;
    around.reactions = reactions_of(around.inertia, state, acceleration, force.points);
}

PointForce CoupledStep::in_level(const Forces& forces, const Key& key) {
    if (key == forces.source || !kind_.has_points) return forces.force;
    const SolverLevel &source = level(forces.source), &target = level(key);
    PointForce result = forces.force;
    result.modal += (target.rows - source.rows).transpose() * result.points;
    if (!forces.around.reactions) return result;
    const Vector change = caused(*forces.around.reactions, key) - caused(*forces.around.reactions, forces.source);
    result.modal += target.rows.transpose() * change;
    result.points += change;
    return result;
}

// ---------------------------------------------------------------------- motion under held forces

// Holds forces for the motion that follows; at_start: those in the level that the step begins in, if they are others.
void CoupledStep::hold(const Forces& forces, const PointForce* at_start, const Key* start) {
    if (levels_->bytes() > most_bytes) levels_->forget();
    const auto kept = std::make_shared<const Forces>(forces);
    const std::optional<PointForce> first = at_start ? std::optional(*at_start) : std::nullopt;
    const Key first_key = start ? *start : Key();
    const auto force_in = [this, kept, first, first_key](const Key& key) -> HeldForce {
        const PointForce force = first && key == first_key ? *first : in_level(*kept, key);
        return {force.modal, level(key).reactions * force.points};
    };
    std::optional<multiphi::AttachedInertia> attached;
    const std::shared_ptr<const PointInertia> inertia = forces.around.inertia;
    const auto rows_in = [this](const Key& key) -> Matrix { return level(key).rows.leftCols(plain(key).modes()); };
    if (inertia)
        attached = AttachedInertia{
            [inertia, rows_in](const Key& key) { return inertia->mobility(rows_in(key)); },
            [inertia, rows_in](const Key& source, const Key& target, const Matrix& matrix) {
                return inertia->velocity_map(rows_in(source), rows_in(target), matrix);
            }};
    levels_->set_forces(force_in, std::move(attached));
    if (!is_any_rigid_ || inertia == attached_) return;
    attached_ = inertia;
    const Model& model = levels_->model();
    Flags immovable(static_cast<std::size_t>(model.size()), 0);
    Matrix directions(0, 0);
    if (inertia) {
        directions = model.unit_directions;
        directions.topRows(model.size()) = inertia->reduced(model.unit_directions.topRows(model.size()), impact_links_);
        for (const int link : inertia->immovable(model.base.directions, impact_links_))
            immovable.at(static_cast<std::size_t>(link)) = 1;
    }
    const double independence = inertia ? std::sqrt(impact::immovable) : round_off::independent;
    run_.law().set_attached(std::move(directions), independence, std::move(immovable));
}

// Advances to `until`, or to the first event. The events of a trial are not kept, as the advance will be repeated; one
// that fails ends in the state right before the failure.
CoupledStep::Advanced CoupledStep::advance(const StepState& state, double time, double until, bool trial) {
    const Chatter chatter = run_.chatter();
    bool failed = false;
    const auto keep = [&] {
        if (trial) {
            run_.chatter() = chatter;
        } else {
            const std::vector<Event>& events = run_.trajectory().events;
            events_.insert(events_.end(), events.begin(), events.end());
        }
    };
    try {
        run_.begin_step(time, state);
        run_.advance(until, true);
    } catch (const NumericalFailure& failure) {
        failed = trial && !is_of_a_level(failure.cause());
        if (!failed) {
            keep();
            throw;
        }
    }
    keep();
    return {run_.time(), run_.step_state(run_.current()), failed || !run_.trajectory().events.empty(),
            run_.step_state(run_.reached())};
}

State CoupledStep::state_in(const StepState& state) {
    const Level& level = plain(state.key);
    const Index r = level.modes(), h = level.channels() - level.prescribed();
    State result;
    result.enter(level);
    result.displacement << state.displacement.head(r), Vector::Zero(level.prescribed()), state.displacement.tail(h);
    result.velocity << state.velocity.head(r), Vector::Zero(level.prescribed()), state.velocity.tail(h);
    return result;
}

double CoupledStep::kinetic_energy_of(const StepState& state, const Surroundings& around) {
    double energy = kinetic_energy(state_in(state));
    if (around.inertia) {
        const Index r = plain(state.key).modes();
        const Vector speeds = level(state.key).rows.leftCols(r) * state.velocity.head(r);
        energy += 0.5 * speeds.dot(around.inertia->mass() * speeds);
    }
    return energy;
}

// Force right after an event, from that right before it, and the change (n,) in the system: of accelerations where
// something is attached to the points, else of forces.
CoupledStep::Evaluated CoupledStep::force_after_event(const Surroundings& around, const Advanced& event,
                                                      const PointForce& force, double end) {
    const Key old = key_, entered = event.state.key;
    const StepState &before = event.before, &after = event.state;
    const Index h = held_.size();
    write(old, before.displacement.tail(h), before.displacement, before.velocity, force.modal + own_force(old, end));
    const Forces forces{force, old, around};
    const Vector modal_after = in_level(forces, entered).modal + own_force(entered, end);
    const Vector held = after.displacement.tail(h);
    Evaluated first, second;
    if (!around.inertia) {
        first = external_forces(old);
        write(entered, held, after.displacement, after.velocity, modal_after);
        second = external_forces(entered);
    } else {
        const Vector displacement = q(), velocity = v();
        first = from_accelerations();
        set_level(entered, held, level(entered).drive);
        write(entered, held, after.displacement, after.velocity, modal_after);
        move_parts(*around.parts, displacement, velocity);
        second = from_accelerations();
    }
    PointForce remainder{force.modal - first.force.modal, force.points - first.force.points};
    if (kind_.has_points)
        remainder.modal += (level(entered).rows - level(old).rows).transpose() * remainder.points;
    return {{second.force.modal + remainder.modal, second.force.points + remainder.points},
            second.system - first.system};
}

// y' (m,) of the points in a state of the body, as the solver has it.
Vector CoupledStep::point_velocity(const StepState& state, const PointForce& force) {
    const SolverLevel& in = level(state.key);
    const Index r = plain(state.key).modes(), s = size_;
    Vector modal = Vector::Zero(3 * s);
    modal.head(r) = state.displacement.head(r);
    modal.segment(s, r) = state.velocity.head(r);
    modal.tail(s) = force.modal + in.drive;
    return in.rows * (in.rates.topRows(s) * modal);
}

// Gives body and attached parts one velocity at the points at the end of the step.
//
// The solver's step moves the attached parts, and the exact step the body. Where the step is long for the body's modes,
// or the force changes within it, their velocities differ at the points. They become one as in an impact, with equal and
// opposite impulses. If the parts followed the body instead, a heavy part would take over every vibration of a light
// body. jumps: of y' (m,) at all events, in which the attached parts take part.
void CoupledStep::join(StepState& state, const Forces& forces, const Advanced& event, double end, const Vector& change,
                       const Vector& jumps) {
    if (!forces.around.inertia) return;
    const Vector of_parts = forces.around.velocity + (end - event.time) * change;
    const Vector difference =
        point_velocity(state, in_level(forces, state.key)) - Vector(of_parts(places_.points)) - jumps;
    const SolverLevel& in = level(state.key);
    const Index r = plain(state.key).modes();
    const Matrix rows = in.rows.leftCols(r) * in.from_velocity.topLeftCorner(r, r);
    state.velocity.head(r) += forces.around.inertia->joining(rows, difference);
}

// Force at the end of the step, after the system has followed the body since the event.
CoupledStep::Evaluated CoupledStep::force_at_end(const Surroundings& around, double elapsed, const Vector& change) {
    if (around.inertia) {
        move_parts(*around.parts, around.displacement, around.velocity + elapsed * change);
        return from_accelerations();
    }
    apply_force_jump(*around.parts, elapsed, change);
    Evaluated result = external_forces(key_);
    Vector::Map(places_.multipliers, places_.constraints)(places_.ties) = result.force.points;
    return result;
}

// A link that attached masses and constraints drive into its stop, to which they leave no mobility; -1 for none.
int CoupledStep::driven_link(const Surroundings& around, const Vector& x_end) {
    if (!around.inertia || rigid_.empty()) return -1;
    const LevelData& data = plain(key_).data();
    Vector xi(data.gap_rows.cols());
    xi << x_end.head(plain(key_).modes()), held_;
    for (const int link : around.inertia->immovable(levels_->model().base.directions, impact_links_)) {
        if (std::find(data.links.begin(), data.links.end(), link) != data.links.end()) continue;
        const Vector terms = data.gap_rows.row(link).transpose().cwiseProduct(xi);
        const double constant = data.gap_constants[link];
        if (terms.sum() + constant < -drift * (terms.cwiseAbs().sum() + std::abs(constant))) return link;
    }
    return -1;
}

RepeatedStep CoupledStep::repeat(SolverSystem& system, double start, double end, const Vector& x_start, StepState state,
                                 double largest_energy, bool load_jumps) {
    system_ = &system;
    key_ = state.key;
    const ForcesOfStep ends{*levels_};
    const Index r = plain(key_).modes(), h = state.displacement.size() - r;
    held_ = state.displacement.tail(h);
    size_ = level(key_).size();
    if (others_.empty() && kind_.has_points) {
        std::vector<int> own(places_.points);
        for (int i = 0; i < size_; ++i) own.push_back(places_.first + i);
        others_ = complement(places_.coordinates, own);
    }
    const Index s = size_, m = static_cast<Index>(places_.points.size());
    const Vector x_end = own_state(), acceleration = x_end.tail(s);
    const PointForce at_start = external(x_start.head(3 * s), x_start.tail(m));
    const PointForce at_end = external(x_end, point_forces());
    const Vector own_start = own_force(key_, start);
    PointForce force{(at_start.modal + at_end.modal - own_start - own_force(key_, end)) / 2.0,
                     (at_start.points + at_end.points) / 2.0};
    clear_solver_residual(force, acceleration);
    const Surroundings around = surroundings(x_end);
    RepeatedStep result;
    result.largest_energy = largest_energy;
    result.driven = driven_link(around, x_end);
    if (result.driven >= 0) return result;

    Vector solver(3 * s);
    solver << x_start.head(2 * s), force.modal + own_start + level(key_).drive;
    state.displacement.head(r) = x_start.head(r);
    state.velocity.setZero();
    state.velocity.head(r) = (level(key_).velocity_inverse * (level(key_).difference * solver)).head(r);
    const Key begun = key_;
    const Forces before{force, begun, around};
    const bool later_forces = kind_.depends_on_later_forces();
    hold(before);
    const Advanced event = advance(state, start, end, later_forces);
    if (!event.has_changed) {
        if (load_jumps) write_end(event.state, force, end);
        result.state = event.state;
        result.energy = kinetic_energy(state_in(result.state)) + strain_energy(state_in(result.state));
        return result;
    }
    Evaluated after = force_after_event(around, event, force, end);
    clear_solver_residual(after.force, acceleration);
    Forces later{after.force, event.state.key, around};
    if (kind_.has_points && around.inertia && later_forces) {
        later.around.parts = attached_parts(around, end - event.time);
        later.around.inertia = inertia_of(*later.around.parts);
        set_reactions_at(later.around, event.before, force);
    }
    Advanced now = event;
    if (later_forces) {  // they determine reactions and accelerations, and so the level after the event
        hold(later, &force, &begun);
        now = advance(state, start, end, false);
    }
    const Surroundings at_event = later.around;
    const auto point_jump = [&](const Advanced& jumped, const PointForce& force_before,
                                const Forces& forces) -> Vector {
        if (!forces.around.inertia) return Vector::Zero(m);
        return point_velocity(jumped.state, in_level(forces, jumped.state.key)) -
               point_velocity(jumped.before, force_before);
    };
    Vector jumps = point_jump(now, force, later);
    while (now.time < end) {  // all further events
        const Forces held = later;
        hold(later);
        Advanced next = advance(now.state, now.time, end, kind_.has_friction);
        if (kind_.has_friction) {
            if (next.has_changed) {
                const Key key = next.before.key;
                later.force = in_level(held, key);
                later.source = key;
                set_reactions_at(later.around, next.before, later.force);
                hold(later);
            }
            next = advance(now.state, now.time, end, false);
        }
        if (next.has_changed) jumps += point_jump(next, in_level(held, next.before.key), later);
        now = std::move(next);
    }
    result.has_changed = true;
    result.state = std::move(now.state);
    result.event_time = event.time;
    const PointForce held_force = in_level(later, result.state.key);
    join(result.state, {held_force, result.state.key, at_event}, event, end, after.system, jumps);
    write_end(result.state, held_force, end);
    result.energy = kinetic_energy(state_in(result.state)) + strain_energy(state_in(result.state));
    if (!kind_.has_points) return result;
    const PointForce force_end = force_at_end(at_event, end - event.time, after.system).force;
    const Level& old = plain(begun);
    const double kinetic = kinetic_energy_of(event.before, at_event);
    const double strain = 0.5 * old.data().squares.cwiseAbs().dot(event.before.displacement.head(r).cwiseAbs2());
    result.largest_energy = std::max(largest_energy, kinetic + strain);
    double gained = kinetic_energy_of(result.state, at_event) + potential_energy(state_in(result.state)) - kinetic -
                    potential_energy(state_in(event.before));
    if (result.state.key == event.state.key) {
        const Index modes = plain(result.state.key).modes();
        const Vector moved = (result.state.displacement - event.state.displacement).head(modes);
        const double work = (force_end.modal - held_force.modal).head(modes).dot(moved);
        gained = std::max(gained, std::abs(work) / (2.0 * unresolved));
    }
    result.is_unresolved = gained > result.largest_energy;
    if (!result.is_unresolved) write_end(result.state, force_end, end);
    return result;
}

}  // namespace multiphi
