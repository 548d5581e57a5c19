"""Law of events: when an element changes its state, and which level follows. It is the same for every run and body.

Every contact has a signal s that says whether its present state is admissible, s >= 0:

    open                 s = g         gap
    closed, compliant    s = -g        penetration
    closed, rigid        s = lambda    reaction
    closed, viscous      s = lambda    force of spring and damper

With all modes the states exclude each other: at the instant at which one stops being admissible another one begins to
be. The truncated bases of two levels need not agree, so the law says what happens then. Each sentence is followed by
the functions that implement it:

1. A contact is *armed* while s >= 0. When s falls through zero it requests a change of state.
   -> phases.phase_of, monitoring.watch, monitoring.collect_requests, decision.decide_jump
2. A rigid contact that requests to close is decided together with all rigid contacts that touch, in the basis of the
   level in which all of them are open: first Moreau's impact, then complementarity of acceleration and reaction. A
   contact closes only if its reaction in the level entered is >= 0. A contact counts as at rest at its stop also if its
   free motion brings it back before its gap is more than round-off: this ends a sequence of ever smaller bounces. A
   contact whose gap the closed contacts already fix stays open at its stop, without a force: of redundant contacts an
   independent set carries all forces, of those that close together the roughest ones.
   -> striking.impact, impact.collide, resting.list_resting, resting.find_pressed, resting.drop_pulled,
   redundancy.keep_independent, striking.close_without_impact
3. A rigid contact that requests to open always opens: it never pulls. Friction that requests a change always changes,
   except for friction that has gone from stick to slip at the same instant: it keeps slipping if truncation has left it
   a velocity against its slip. If its spring has dropped from its static limit it sticks again, as its normal force may
   fall faster than its spring force.
   -> switching.is_unconditional, switching.open_and_enter, phases.is_pulled, sticking.open_pulled
4. A compliant contact that requests a change makes it, unless s in the level it would enter is negative and falling. If
   several contacts request changes together and are refused, the first one that is admitted alone changes.
   -> switching.try_targets, switching.switch, phases.is_denied
5. A contact whose s is negative after a change, by truncation, is *recovering*: it keeps its state while s rises, is
   armed when s reaches zero, and requests a change again if s begins to fall before.
   -> phases.phase_of, monitoring.watch
6. A contact that may not make the change it requests is *refused*: it keeps its state until s has risen to zero (then
   it is armed), or until s in the level it would enter has risen to zero (then it changes). If it would then repeat its
   request at the same instant without end, it is *held back* until s has risen to zero, or until another contact
   requests a change.
   -> phases.update_phases, monitoring.watch, monitoring.flag_repeated_requests, phases.hold_back
7. A viscous contact never pulls. It opens when its force falls to zero, mostly before its gap has risen to zero. It is
   then open with g < 0 and refused as in 6: it is armed when g has risen to zero, and closes when its force in the
   level with it closed has risen to zero. It may stay closed only with a force >= 0, and may open if its force would be
   negative. Truncation may leave it a force there at the instant at which it opens: it opens if this falls, and closes
   when it has risen to as much again. If others that change at the instant make its force negative it opens too, after
   a change of its own. It bears no impulse: at the instant of an impact it keeps its state until that is over, and is
   decided with the velocities after it.
   -> switching.would_pull_if_closed, monitoring.wait_for, decision.classify_refusals, decision.follows_impact
8. A force law requests the next segment at either end of its present one, and always changes. If truncation has moved
   its displacement further, it requests the segment in which its displacement lies. It goes on at the same instant
   until its segment contains its displacement, but does not return to the segment that it has just left.
   -> changes.segment_at, changes.set_requested_states, switching.is_unconditional, decision.is_return
9. The sign of a signal is that of its first derivative, of order zero or higher, that is not round-off: of its terms,
   of the earlier motion, or of the map that has made the state.
   -> signals.row_sign, signals.rate_sign, phases.becomes
10. A contact with friction and a tangential spring sticks when it closes. Without a spring it slides in the direction
   of its slip velocity, or sticks if that is zero. A stick or slip that cannot last does not prevent closing: exits
   that are always taken follow at the same instant. A spring that truncation has left beyond the limit sticks while its
   force returns to the limit. One that reaches its limit at the instant of an impact sticks in it, and slips after it
   only if its force would then exceed the limit. When its normal force falls to zero the contact opens, and its
   friction ends.
   A rigid contact that strikes has a tangential impulse of at most mu times its normal impulse, together with all that
   touch, with or without a slip velocity. After the impact a sliding contact exerts its friction force, and one at rest
   sticks up to its static limit. A contact that starts at its stop starts in stick, and of redundant ones an
   independent set sticks.
   -> changes.set_requested_states, phases.is_denied, decision.apply_requests, impact.add_friction_rows,
   resting.sliding_level, rebounds.flag_touching
11. A rigid contact with restitution e that strikes leaves its stop with -e times its velocity. So do all contacts that
   touch and are struck with it, in one impact (Moreau); coupled ones must have one e. A touching contact that leaves
   its stop has at least the e of those that are struck, or it would gain energy. A contact that others drive back to
   its stop is struck again at the same instant, at the start too, until what is left is round-off. If any of them has
   friction, e is that of impulses: an impact without restitution, then one with at least e times its impulses
   (Poisson). A bounce that is too low or too short to be resolved is the last: it takes as long as all bounces that
   would follow, and at its end e is zero.
   -> rebounds.flag_touching, rebounds.set_rebound_speeds, rebounds.lend_restitutions, rebounds.collide_and_rebound,
   rebounds.repeat_impacts, bounces.last_bounce, bounces.mark_last_bounces
12. Rigid friction elements that stick, reverse or begin to slip at an instant are decided together, those at contacts
   that are not rigid with their present mu N. Their forces are within their limits, static ones until they slip, and
   complementary to their accelerations. Of the elements that then fall from their static limits those that reverse
   their slip fall first: others may bear less after it, and go on sticking. Of several, an element that needs just its
   limit, to round-off, slips; one that needs just a larger static limit sticks, unless it requests slip. What depends
   on the next derivative, or on truncation, each element decides alone.
   Of redundant elements an independent set sticks; the one that bears most beyond its limit falls last, the last one of
   equal ones. The others exert their limit as if they slipped, or are idle at a contact that is not rigid. They take
   over when needed, also from an element that only round-off keeps within its limit. The motion is the same if not more
   than one of them has a static limit. This holds for redundant friction along a closed rigid contact too.
   A rigid contact that would pull beside the sticking elements opens, and all is decided again without it. So does one
   beside which elements fall, if it would pull with them sticking, and all of them stick without it. None of these
   elements bears an impulse, nor does the friction of a contact that is not rigid.
   -> sticking.stick_together, sticking.decide_at_rest, friction_problem.sort_by_reserve, sticking.choose_states,
   sticking.stick_independent_set, sticking.open_pulled, sticking.retry_without_pulled, redundancy.drop_redundant_stick,
   redundancy.is_redundant_stick, striking.slip_after_impact, changes.bears_no_impulse, changes.state_without_stick

All instants are roots of analytic signals, so nothing depends on sampling.

Order: impact_round_off, impact, phases, changes, redundancy, bounces, rebounds, resting, striking, switching,
friction_problem, sticking, decision, monitoring, first_state.
"""
