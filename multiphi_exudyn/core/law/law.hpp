// The law of events: when an element changes its state, and which level follows. It is the same for every run and body.
//
// Every contact has a signal s that says whether its present state is admissible, s >= 0:
//
//     open                 s = g         gap
//     closed, compliant    s = -g        penetration
//     closed, rigid        s = lambda    reaction
//     closed, viscous      s = lambda    force of spring and damper
//
// With all modes the states exclude each other: at the instant at which one stops being admissible another one begins to
// be. The truncated bases of two levels need not agree, so the law says what happens then, in twelve sentences. Each
// stands above the functions that implement it. All instants are roots of analytic signals, so nothing depends on
// sampling.
//
// How the functions call each other at an instant (each in the file of its name, or where it says so):
//
//     Run::advance_segment   watch, and at the first descent collect_requests                    (monitoring.cpp)
//     decide                 the state right after the instant, and what has changed and is lost
//       settle               decides until no element that is refused is still untreated         (decide.cpp)
//         apply_requests     passes what is requested on                                         (decide.cpp)
//           strike             rigid contacts that close: impact.cpp, restitution.cpp, then rest.cpp
//           close_without_impact                                                                 (strike.cpp)
//           stick_together     friction at rest                                                  (stick.cpp)
//           switch_states      all others                                                        (switching.cpp)
//         enter              the state of the next level, with its phases                        (decide.cpp, phase.cpp)
#pragma once

#include <utility>
#include <vector>

#include "energy.hpp"
#include "law/exchanges.hpp"
#include "law/impact.hpp"
#include "law/instant.hpp"
#include "levels.hpp"
#include "motion.hpp"
#include "round_off.hpp"
#include "search.hpp"
#include "state.hpp"

namespace multiphi {

// Initial conditions of a run in base coordinates.
struct Start {
    Vector displacement, velocity;  // y, y' (m,)
    Vector held;                    // displacements that links hold (h,) [m]
    Key states;                     // contacts that touch their stop at the start, or lie inside it, are closed
    double spring_energy = 0.0;     // [J] of the links that act at the start
};

// What a searched signal is waited for.
struct Watched {
    int guard = 0;
    bool requests = false;  // its descent requests a change; else it arms the guard
};

class Law {
  public:
    // exchanges: what the law remembers of earlier instants, kept by the run.
    Law(Levels& levels, const Inputs& inputs, Exchanges& exchanges);

    Instant instant;  // the present one

    // Decides the requests `instant.asked` of `instant.reached`: `instant.trial` becomes the state right after it.
    // Throws NumericalFailure where elements exchange their states without end.
    void decide();
    // 1. Decides after channels have jumped in `instant.reached`; false if no element requests a change.
    bool decide_jump();
    // Decides the start of a run: `instant.reached` and `instant.trial` become the states before and after it.
    void begin(const Start& start);
    const State& start() const { return start_; }  // in the base
    Loss start_loss;                               // of the impact at the start

    // What is attached to the structure: the directions of the links under its inertia (l, m), empty without any; which
    // remainder of a unit direction is redundant; the elements that it leaves no motion: their guards are not watched.
    void set_attached(Matrix directions, double independence, Flags immovable) {
        directions_ = std::move(directions);
        independence_ = independence;
        immovable_ = std::move(immovable);
    }

    // -------------------------------------------------------------------------------------------------------------
    // 1. A contact is *armed* while s >= 0. When s falls through zero it requests a change of state.

    // Lists the signals of a motion whose first descent is searched, by the phases of its level's guards.
    void watch(Motion& motion, const std::vector<Phase>& phases, SearchedSignals& signals,
               std::vector<Watched>& watched);
    // Sets `instant.asked` to the requests of the elements whose signals fall at the time of a descent; false for none.
    bool collect_requests(const Motion& motion, const SearchedSignals& signals, const std::vector<Watched>& watched,
                          int found, double time);

  private:
    enum class Of { signal, rate };
    void wait_for(Motion& motion, const Signal& signal, double sign, Of of, bool is_shifted, SearchedSignals& signals);
    Phase phase_of(const State& state, const Guard& guard);

    // -------------------------------------------------------------------------------------------------------------
    // 2. A rigid contact that requests to close is decided together with all rigid contacts that touch, in the basis of
    // the level in which all of them are open: first Moreau's impact, then complementarity of acceleration and reaction.
    // A contact closes only if its reaction in the level entered is >= 0. A contact counts as at rest at its stop also
    // if its free motion brings it back before its gap is more than round-off: this ends a sequence of ever smaller
    // bounces. A contact that truncation has left inside its stop touches it too, and is at rest if its free motion
    // brings it back before its gap has risen to zero: where all together can carry, none of them is missing. A contact
    // whose gap the closed contacts already fix stays open at its stop, without a force: of redundant contacts an
    // independent set carries all forces, of those that close together the roughest ones.
    void strike();
    void close_without_impact(const Requests& requests);
    static bool is_inside(const State& state, int contact);
    bool come_inside(const Requests& requests) const;
    int find_pressed();
    std::size_t list_resting(bool unseen);
    void solve_resting_forces();
    int drop_pulled(bool is_same);
    void remove_negligible_velocities();
    int reaction_sign(const State& displaced, const State& moving, const Level& level, int contact);
    void record_impact_changes();
    int keep_independent(Flags& closing, const std::vector<int>& held);

    // -------------------------------------------------------------------------------------------------------------
    // 3. A rigid contact that requests to open always opens: it never pulls. Friction that requests a change always
    // changes, except for friction that has gone from stick to slip at the same instant: it keeps slipping if truncation
    // has left it a velocity against its slip. If its spring has dropped from its static limit it sticks again, as its
    // normal force may fall faster than its spring force.
    bool is_unconditional(int element, int requested) const;
    void open_and_enter();
    bool is_pulled(const State& state);

    // -------------------------------------------------------------------------------------------------------------
    // 4. A compliant contact that requests a change makes it, unless s in the level it would enter is negative and
    // falling. If several contacts request changes together and are refused, the first one that is admitted alone
    // changes.
    void switch_states(const Requests& requests);
    int try_targets();  // the number of refused ones, flagged in denied_
    bool is_denied(const State& state, int element) const;
    static bool is_refused(const State& state, int element);

    // -------------------------------------------------------------------------------------------------------------
    // 5. A contact whose s is negative after a change, by truncation, is *recovering*: it keeps its state while s rises,
    // is armed when s reaches zero, and requests a change again if s begins to fall before.
    //
    // 6. A contact that may not make the change it requests is *refused*: it keeps its state until s has risen to zero
    // (then it is armed), or until s in the level it would enter has risen to zero (then it changes). If it would then
    // repeat its request at the same instant, alone or in turn with others, it is *held back* until s has risen to zero,
    // or until another contact requests a change at a later instant, or changes. An impact of contacts that come inside
    // their stops, after which all are as they were, does not take place, as it would be repeated without end: they
    // close without it, or are refused. In truncated models a rigid contact without restitution that closes many times
    // within a period of the fastest mode or load exchanges its state with others without end: what they do to each
    // other so fast is no motion of these modes. It is held open for such a period, takes part in no impact meanwhile,
    // and is then decided anew.
    void update_phases(State& state, const Flags* refused);
    void hold_back(State& state);
    void arm_return_guards();
    void hold_exchanging(State& state);
    void count_closings();

  public:
    double next_release() const { return exchanges_->next_release(instant.time); }
    // Decides which of the contacts held open until the instant request to close; `start`: of the segment.
    bool release_held(double start);
    static void arm(State& reached, int guard);
    void flag_repeated_requests(bool at_once);

    // -------------------------------------------------------------------------------------------------------------
    // 7. A viscous contact never pulls. It opens when its force falls to zero, mostly before its gap has risen to zero.
    // It is then open with g < 0 and refused as in 6: it is armed when g has risen to zero, and closes when its force in
    // the level with it closed has risen to zero. It may stay closed only with a force >= 0, and may open if its force
    // would be negative. Truncation may leave it a force there at the instant at which it opens: it opens if this falls,
    // and closes when it has risen to as much again. If others that change at the instant make its force negative it
    // opens too, after a change of its own. It bears no impulse: at the instant of an impact it keeps its state until
    // that is over, and is decided with the velocities after it.
  private:
    bool follows_impact(const Requests& requests, int element) const;
    bool would_pull_if_closed(const State& state, int element);
    enum class Refusals { none, untreated, always_taken, others };
    Refusals classify_refusals();

    // -------------------------------------------------------------------------------------------------------------
    // 8. A force law requests the next segment at either end of its present one, and always changes. If truncation has
    // moved its displacement further, it requests the segment in which its displacement lies. It goes on at the same
    // instant until its segment contains its displacement, but does not return to the segment that it has just left.
    void set_requested_states(Requests& requests);
    int segment_at(const State& state, int element) const;
    bool is_return(int element, int requested) const;

    // -------------------------------------------------------------------------------------------------------------
    // 9. The sign of a signal is that of its first derivative, of order zero or higher, that is not round-off: of its
    // terms, of the earlier motion, or of the map that has made the state.            (state.hpp: signal_sign, rate_sign)
    int first_derivative_sign(const State& state, const Signal& signal, int since);

    // -------------------------------------------------------------------------------------------------------------
    // 10. A contact with friction and a tangential spring sticks when it closes. Without a spring it slides in the
    // direction of its slip velocity, or sticks if that is zero. A stick or slip that cannot last does not prevent
    // closing: guards that are always taken follow at the same instant. A spring that truncation has left beyond the
    // limit sticks while its force returns to the limit. One that reaches its limit at the instant of an impact sticks
    // in it, and slips after it only if its force would then exceed the limit. When its normal force falls to zero the
    // contact opens, and its friction ends.
    // A rigid contact that strikes has a tangential impulse of at most mu times its normal impulse, together with all
    // that touch, with or without a slip velocity. After the impact a sliding contact exerts its friction force, and one
    // at rest sticks up to its static limit. A contact that starts at its stop starts in stick, and of redundant ones an
    // independent set sticks.                                                     (impact.hpp: Impact::add_friction_rows)
    void apply_requests(Requests& requests);
    void refuse_sliding_level();

    // -------------------------------------------------------------------------------------------------------------
    // 11. A rigid contact with restitution e that strikes leaves its stop with -e times its velocity. So do all contacts
    // that touch and are struck with it, in one impact (Moreau); coupled ones must have one e. A touching contact that
    // leaves its stop has at least the e of those that are struck, or it would gain energy. A contact that others drive
    // back to its stop is struck again at the same instant, at the start too, until what is left is round-off. If any of
    // them has friction, e is that of impulses: an impact without restitution, then one with at least e times its
    // impulses (Poisson). A bounce that is too low or too short to be resolved is the last: it takes as long as all
    // bounces that would follow, and at its end e is zero.
    void flag_touching(const Requests& requests);
    bool set_rebound_velocities(const State& state);
    void find_coupled(const Level& level);
    void check_restitutions(const State& state);
    void lend_restitutions(const State& state);
    void collide_and_rebound(const State& state, bool rebounds, State& result, Loss& loss);
    void repeat_impacts(State& struck, Loss& loss);
    void apply_further_impact(State& struck, Loss& loss);
    bool has_rebounded(int touching) const;
    bool is_on_last_bounce(int element) const;
    double gap_velocity(const State& state, int touching) const;
    double returned_share(int touching, double velocity) const;
    int begin_last_bounces();
    void mark_last_bounces();

  public:
    // Whether the instant has changed nothing but rebounds of contacts with restitution below 1.
    bool is_rebound_only() const;

    // -------------------------------------------------------------------------------------------------------------
    // 12. Rigid friction elements that stick, reverse or begin to slip at an instant are decided together, those at
    // contacts that are not rigid with their present mu N. Their forces are within their limits, static ones until they
    // slip, and complementary to their accelerations. Of the elements that then fall from their static limits those that
    // reverse their slip fall first: others may bear less after it, and go on sticking. Of several, an element that
    // needs just its limit, to round-off, slips; one that needs just a larger static limit sticks, unless it requests
    // slip. What depends on the next derivative, or on truncation, each element decides alone.
    // Of redundant elements an independent set sticks; the one that bears most beyond its limit falls last, the last one
    // of equal ones. The others exert their limit as if they slipped, or are idle at a contact that is not rigid. They
    // take over when needed, also from an element that only round-off keeps within its limit. The motion is the same if
    // not more than one of them has a static limit. This holds for redundant friction along a closed rigid contact too.
    // A rigid contact that would pull beside the sticking elements opens, and all is decided again without it. So does
    // one beside which elements fall, if it would pull with them sticking, and all of them stick without it. None of
    // these elements bears an impulse, nor does the friction of a contact that is not rigid.
  private:
    void stick_together(Requests& requests);
    int decide_at_rest(const Requests& requests);
    void retry_without_pulled(const Requests& requests);
    bool open_pulled();
    int choose_states(const Requests& requests);
    void stick_independent_set(const Key& slipping);
    void fill_friction_rows(const Level& level, const std::vector<int>& elements);
    void zero_resting_velocities();
    bool list_at_rest(const Requests& requests);
    void sort_by_reserve();
    void pose_friction_problem(const Requests& requests);
    double slip_force(int element, double limit) const;
    double normal_force(int element) const;
    bool is_at_limit(int element, int requested) const;
    void drop_redundant_stick(Requests& targets);
    bool is_redundant_stick(const Key& key, int element);
    int held_links(int element, int state) const;
    bool are_independent(const std::vector<int>& held);
    bool bears_no_impulse(int element) const;
    void slip_after_impact();
    int state_without_stick(int element, int before) const;

    // ------------------------------------------------------------------------------------------------------------- parts

    void settle();                                             // repeats decisions until no refused element is untreated
    bool is_reversed_by_impact(int guard) const;
    void transfer(const State& state, const Key& key, State& result);  // (38.6), with its losses to truncation
    void enter(const State& state);                            // makes a state the trial, with its phases and losses
    void record_change(int element, int entered, double impulse);
    void enter_start(const Start& start);
    bool strike_start(const Level& open_level);
    void enter_given(const State& velocities, const Level& level, State& result);

    Levels* levels_;
    const Model* model_;
    const Inputs* inputs_;
    Exchanges* exchanges_;
    Impact impact_;
    Mover mover_;
    Motion motion_;  // of a state under trial
    Flags immovable_;

    // States under trial. In an impact: released before it, all touching contacts open; struck after it; at rest without
    // negligible velocities; entered in the level of the contacts that stay closed. `compressed`: after the compression
    // of an impact with friction and restitution. In the base: start and after_impact, before and after its impact.
    State candidate_, released_, struck_, at_rest_, entered_, compressed_, start_, after_impact_;

    Requests targets_;              // trial changes
    Requests pending_, pulling_;    // of refused elements not treated yet; of guards that are taken unconditionally
    Flags striking_, denied_, closed_;
    Key key_;                       // of a level under trial
    Key open_key_;                  // the key with all touching contacts open
    std::vector<int> touching_;     // contacts that take part in the impact
    std::vector<int> resting_;      // of these those at rest; or the friction elements at rest
    std::vector<int> groups_;       // of touching contacts: equal numbers if impulses couple them
    std::vector<int> held_;         // links that hold beside those that close, see held_links
    std::vector<double> impulses_, further_impulses_;  // of the touching contacts [N s]
    std::vector<double> wanted_;    // their gap velocities after an impact, or least impulses
    std::vector<double> resting_sizes_;
    std::vector<int> union_;        // of links held and closing ones, see held_links
    std::vector<double> orthonormal_;
    Matrix directions_;             // of the links under attached inertia (l, m); empty without it: the model's
    double independence_ = round_off::independent;  // of unit directions: a smaller remainder is redundant
    Loss impact_loss_, at_rest_loss_;
    Vector acceleration_, acceleration_sizes_, released_sizes_;
    std::vector<Complex> coefficients_, phi_;  // of a signal on a motion
    std::vector<double> sizes_;
    std::vector<char> fallen_;
};

}  // namespace multiphi
