"""Events: when a contact closes or opens, which level follows, and with what state (eq. 38.6).

A transition takes a state from one level into another. Signals of the state say whether an element may stay as it is
(exits). The law decides from them, and is the same in every driver of the model. It works on flat arrays, for
the loop of a run: arrays says what stands where, and level_arrays puts it there. Where it is stated:

    (38.3)  eta'' of a state              state_arrays.accelerate
    (38.6)  a state in another level      maps.move; its matrices transition.Transition
    1       armed, and asking             phases.phase_of, monitoring.watch, monitoring.who_asks, decision.decide_jump
    2       rigid contacts that strike    striking.impact, impact.collide, striking.close_without_impact
    2       those at rest after it        resting.list_resting, resting.press, resting.stay_closed, redundancy.join
    3       a rigid contact opens         switching.is_firm, switching.open_and_enter, phases.is_pulled, sticking.let_go
    4       a compliant contact changes   switching.try_wishes, switching.switch, phases.is_denied
    5       recovering                    phases.phase_of, monitoring.watch
    6       refused, and held back        phases.update_phases, phases.hold_back, monitoring.watch
    6       and asked again               monitoring.flag_again
    7       a viscous contact             switching.is_relaxing
    8       a force law asks              changes.turn_wishes, changes.segment_at
    8       and changes                   switching.is_firm, decision.is_latest
    9       the sign of a signal          signals.row_sign, signals.rate_sign, phases.becomes
    10      a contact with friction       changes.turn_wishes, phases.is_denied
    10      a rigid one that strikes      impact.rub, resting.sliding_level, rebounds.hear_touching
    11      restitution                   rebounds.hear_touching, rebounds.rebound, rebounds.bounce
    11      beside friction               rebounds.collide_and_rebound
    11      the last bounce               bounces.last_bounce, bounces.keep_landing
    12      friction at rest              sticking.stick_together, sticking.decide_at_rest, sticking.choose
    12      beside rigid contacts         sticking.let_go, sticking.hold_without, redundancy.follows
    12      redundant friction            friction_problem.sort_by_reserve, sticking.thin_out_idle, redundancy.thin_out
    12      which of it is idle           changes.without_stick
    12      its impacts                   changes.bears_nothing, striking.slide_on

The sentences themselves stand in decision, where an instant is decided: decide, settle, answer.

Order: excitation, transitions, arrays, states, law, packing.
"""
