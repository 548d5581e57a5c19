// Coupled step: a step of another solver, in which the structure is one body beside others, computed again exactly,
// from event to event.
//
//     before the first event   the mean of the forces at both ends of the step, transformed to the modes of each level
//     after it                 the same, plus the change of reactions, loads, connectors and inertia at the event
//
// (p, f) are the forces on the body: p (s,) on its modal coordinates, f (m,) on its points, which constraints of the
// solver, the ties, hold at y = R q + c. Multipliers of constraints at the end of a step are not used: the trapezoidal
// rule makes them alternate, and only their mean is right. To find what an event changes in the system, the states
// right before and right after it are written into it:
//
//     (p, f) right after = (p, f) right before + change of the system's forces from the state before to that after
//
// With connectors and loads alone, the change is read from the system's forces. With masses or constraints attached to
// the points, the accelerations of the whole system are computed, and the forces of elements cause forces on the
// points too. An impact is one of the body together with all that is attached to it (attached_parts.hpp). At the end of
// the step, body and attached parts get one velocity at the points, with equal and opposite impulses.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "attached_parts.hpp"
#include "held_forces.hpp"
#include "run.hpp"

namespace multiphi {

// A level as the solver integrates it, M q'' + D q' + K q = p + drive, with the points y = R q + c of the body.
struct SolverLevel {
    Matrix equation;         // (s, 3 s) [K D M]
    Vector drive;            // (s,)
    Matrix rates;            // (q', q'') (2 s, 3 s) from (eta, eta', p + drive)
    Matrix difference;       // V eta' (s, 3 s) from (q, q', p + drive),
    Matrix velocity_inverse; //   V^-1 (s, s)
    Matrix physical;         // (eta, eta', eta'') (3 s, 3 s) from (q, q', q'')
    Matrix from_velocity;    // V (s, s) of q' from eta'
    Matrix rows;             // R (m, s)
    Vector offset;           // c (m,) without stick positions,
    Matrix held_offset;      //   (m, h) by these
    Matrix reactions;        // L (k, m): L f are reactions of closed contacts to f that the modes do not contain
    Vector push;             // (b,) constant forces of elements in base coordinates,
    std::vector<int> rubbing;  // elements whose friction is proportional to their pressure,
    Matrix rubbing_forces;   //   (b, e) along which it acts

    Index size() const { return drive.size(); }
    Matrix mass() const { return equation.rightCols(size()); }
};

// The solver's system of which the structure is a part. Its functions evaluate the present state.
class SolverSystem {
  public:
    virtual ~SolverSystem() = default;
    virtual SolverLevel level(const Key& key) = 0;                       // asked for once
    virtual Vector forces() = 0;                                         // f (n,), without those of constraints
    virtual Matrix mass() = 0;                                           // M (n, n)
    virtual Matrix jacobian() = 0;                                       // C (k, n) of all constraints
    virtual Vector constraint_accelerations() = 0;                       // -d(C v + c_t)/dt (k,) at constant v
    virtual void set_level(const Key& key, const Vector& held, const Vector& force) = 0;  // matrices and ties
    virtual Vector own_force(const Key& key, double time) = 0;           // (s,) of varying loads of the body
    virtual void check_attached(const std::vector<int>& coordinates) = 0;  // whether they may be attached to it
};

// Where the solver keeps its state, and which part of it is the body's.
struct SolverPlaces {
    double *displacement = nullptr, *velocity = nullptr, *acceleration = nullptr, *multipliers = nullptr;
    Index coordinates = 0, constraints = 0;  // n, k
    int first = 0;                   // of the body's own coordinates
    std::vector<int> points, ties;   // indices of y among the coordinates, of the ties among the constraints
};

// What a body needs at events.
struct BodyKind {
    bool has_points = false;   // an interface
    bool has_varying_loads = false;
    bool has_rigid = false;    // links
    bool has_friction = false; // stick positions
    bool depends_on_later_forces() const { return has_rigid || has_friction; }
};

// p (s,) and f (m,) in the level of this key.
struct PointForce {
    Vector modal, points;
};

struct RepeatedStep {
    StepState state;              // at its end
    bool has_changed = false;     // by an event: then the state is written into the system
    double largest_energy = 0.0;  // [J] of body and attached masses at the events so far
    double energy = 0.0;          // [J] kinetic and strain energy of the state
    int driven = -1;              // link that attached parts drive into its stop: nothing has been written
    bool is_unresolved = false;   // a constant force after an event is too poor an approximation in such a long step
    double event_time = 0.0;      // [s] of the first event
};

// in_base: R (m, b) of the points in base coordinates.
class CoupledStep {
  public:
    CoupledStep(std::shared_ptr<HeldLevels> levels, Chatter chatter, double time, SolverPlaces places, BodyKind kind,
                Matrix in_base);

    // Computes the step again whose end the system has reached; x_start: (q, q', q'', 1, f) at its start, state: level,
    // phases and stick positions there. load_jumps: an own load jumps in the step.
    RepeatedStep repeat(SolverSystem& system, double start, double end, const Vector& x_start, StepState state,
                        double largest_energy, bool load_jumps);

    // Events of all steps since they were last taken.
    std::vector<Event> take_events();
    const Run& run() const { return run_; }

  private:
    struct Advanced {
        double time;
        StepState state;
        bool has_changed;  // by an event, or as a trial failed
        StepState before;  // right before the last event
    };
    // The forces on the points that the forces of the elements cause at one instant.
    struct Reactions {
        std::shared_ptr<const PointInertia> inertia;
        Vector acceleration;  // y'' (b,) of the body without these forces
        Vector pressures;     // (l,) of all links of finite stiffness, whether they act or not
    };
    // The system around the body at the end of a step, as the step without an event gives it.
    struct Surroundings {
        Vector displacement, velocity;  // (n,) in that state
        std::shared_ptr<const AttachedParts> parts;
        std::shared_ptr<const PointInertia> inertia;  // null where nothing is attached
        std::optional<Reactions> reactions;
    };
    // Forces in all levels: `force` in that of `source`; in the level of `fixed_key` the other one.
    struct Forces {
        PointForce force;
        Key source;
        Surroundings around;
    };
    struct Evaluated {
        PointForce force;
        Vector system;  // accelerations or forces (n,) of the whole system
    };

    const SolverLevel& level(const Key& key);
    const Level& plain(const Key& key) { return levels_->Levels::level(key); }
    std::vector<int> closed_rigid(const Key& key);
    State state_in(const StepState& state);
    double kinetic_energy_of(const StepState& state, const Surroundings& around);

    Eigen::Map<Vector> q() { return {places_.displacement, places_.coordinates}; }
    Eigen::Map<Vector> v() { return {places_.velocity, places_.coordinates}; }
    Eigen::Map<Vector> a() { return {places_.acceleration, places_.coordinates}; }
    Vector own(double* values) const { return Vector::Map(values + places_.first, size_); }
    Vector own_state() const;
    Vector point_forces() const;

    Vector own_force(const Key& key, double time);
    PointForce external(const Vector& x, const Vector& points);
    Evaluated external_forces(const Key& written);
    Evaluated from_accelerations();
    Vector accelerations();
    void write(const Key& key, const Vector& held, const Vector& displacement, const Vector& velocity,
               const Vector& modal_force);
    void write_end(const StepState& state, const PointForce& force, double time);
    void set_level(const Key& key, const Vector& held, const Vector& force);
    void move_parts(const AttachedParts& parts, const Vector& displacement, const Vector& velocity);
    void apply_force_jump(const AttachedParts& parts, double elapsed, const Vector& jump);
    void clear_solver_residual(PointForce& force, const Vector& acceleration) const;

    std::shared_ptr<const AttachedParts> attached_parts(const Surroundings& around, double ago);
    std::shared_ptr<const PointInertia> inertia_of(const AttachedParts& parts);
    Surroundings surroundings(const Vector& x_end);
    Reactions reactions_of(const std::shared_ptr<const PointInertia>& inertia, const StepState& state,
                           const Vector& acceleration, const Vector& points);
    Vector push_of(const Reactions& reactions, const Key& key);
    Vector caused(const Reactions& reactions, const Key& key);
    void set_reactions_at(Surroundings& around, const StepState& state, const PointForce& force);
    PointForce in_level(const Forces& forces, const Key& key);

    void hold(const Forces& forces, const PointForce* at_start = nullptr, const Key* start = nullptr);
    Advanced advance(const StepState& state, double time, double until, bool trial);
    Evaluated force_after_event(const Surroundings& around, const Advanced& event, const PointForce& force, double end);
    Vector point_velocity(const StepState& state, const PointForce& force);
    void join(StepState& state, const Forces& forces, const Advanced& event, double end, const Vector& change,
              const Vector& jumps);
    Evaluated force_at_end(const Surroundings& around, double elapsed, const Vector& change);
    int driven_link(const Surroundings& around, const Vector& x_end);

    std::shared_ptr<HeldLevels> levels_;
    Run run_;
    SolverPlaces places_;
    BodyKind kind_;
    std::vector<int> free_, others_;  // constraints besides the ties; coordinates besides the body's and its points'
    std::vector<int> rigid_, impact_links_;
    std::map<Key, SolverLevel> known_;
    std::vector<Event> events_;
    std::shared_ptr<const PointInertia> attached_;  // that the law knows
    Matrix in_base_;                  // R (m, b)
    bool is_any_rigid_ = false;       // element

    // During a step:
    SolverSystem* system_ = nullptr;
    Key key_;      // of the level whose matrices the system has,
    Vector held_;  //   and the stick positions [m] in its ties
    Index size_ = 0;
};

}  // namespace multiphi
