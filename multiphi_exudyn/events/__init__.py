"""Events: when a contact closes or opens, which level follows, and with what state (eq. 38.6).

A transition takes a state from one level into another. Signals of the state say whether an element may stay as it is
(exits). The law decides from them, and is the same in every driver of the model. It works on flat arrays, for the loop
of a run: arrays documents their layout, and level_arrays fills them. Where each rule is implemented:

    (38.3)  eta'' of a state              state_arrays.accelerate
    (38.6)  a state in another level      maps.move; its matrices transition.Transition
    1       armed                         phases.phase_of, monitoring.watch
    1       requesting a change           monitoring.collect_requests, decision.decide_jump
    2       rigid contacts that strike    striking.impact, impact.collide, striking.close_without_impact
    2       those at rest after it        resting.list_resting, resting.find_pressed, resting.drop_pulled
    2       redundant ones                redundancy.keep_independent
    3       a rigid contact opens         switching.is_unconditional, switching.open_and_enter, phases.is_pulled
    3       beside friction               sticking.open_pulled
    4       a compliant contact changes   switching.try_targets, switching.switch, phases.is_denied
    5       recovering                    phases.phase_of, monitoring.watch
    6       refused, and held back        phases.update_phases, phases.hold_back, monitoring.watch
    6       repeated requests             monitoring.flag_repeated_requests
    7       a viscous contact             switching.would_pull_if_closed
    8       the segment of a force law    changes.set_requested_states, changes.segment_at
    8       and its changes               switching.is_unconditional, decision.is_return
    9       the sign of a signal          signals.row_sign, signals.rate_sign, phases.becomes
    10      a contact with friction       changes.set_requested_states, phases.is_denied
    10      a rigid one that strikes      impact.add_friction_rows, resting.sliding_level, rebounds.flag_touching
    11      restitution                   rebounds.flag_touching, rebounds.set_rebound_speeds
    11      repeated impacts              rebounds.repeat_impacts
    11      beside friction               rebounds.collide_and_rebound
    11      the last bounce               bounces.last_bounce, bounces.mark_last_bounces
    12      friction at rest              sticking.stick_together, sticking.decide_at_rest, sticking.choose_states
    12      beside rigid contacts         sticking.open_pulled, sticking.retry_without_pulled
    12      redundant friction            friction_problem.sort_by_reserve, sticking.stick_independent_set
    12      beside what holds             redundancy.drop_redundant_stick, redundancy.is_redundant_stick
    12      idle friction                 changes.state_without_stick
    12      its impacts                   changes.bears_no_impulse, striking.slip_after_impact

The sentences themselves are in decision, where an instant is decided: decide, settle, apply_requests.

Order: excitation, transitions, arrays, states, law, packing.
"""
