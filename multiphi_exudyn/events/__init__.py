"""Events: when a contact closes or opens, which level follows, and with what state (eq. 38.6).

A transition takes a state from one level into another. Signals of the state say whether a contact may stay as it is
(admissibility). The rule decides from them, and is the same in every driver of the model.

The same on flat arrays, for the loop of a run: arrays says what stands where.

Order: transition, state, admissibility, passage, rule, arrays, flat_state, flow, impact, flat_rule, level_arrays.
"""
