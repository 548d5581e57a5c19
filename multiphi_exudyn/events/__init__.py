"""Events: when a contact closes or opens, which level follows, and with what state (eq. 38.6).

A transition takes a state from one level into another. Signals of the state say whether an element may stay as it is
(exits). The law decides from them, and is the same in every driver of the model. It works on flat arrays, for the loop
of a run: arrays documents their layout, and level_arrays fills them. Where the equations are implemented:

    (38.3)  eta'' of a state              state_arrays.accelerate
    (38.6)  a state in another level      maps.move; its matrices transition.Transition

The twelve sentences of the law, each with its functions, are in the docstring of the room law.

Order: excitation, transitions, arrays, states, law, packing.
"""
