"""Events: the levels under the loads of a run, the states in them and the maps between them (eq. 38.6).

A transition takes a state from one level into another. Signals of the state say whether an element may stay as it is
(exits). The law decides from them, and is the same in every driver of the model; it is in the core, core/law, its
sentences at the head of law.hpp and above the functions that implement them. Where the equations are implemented:

    (38.6)  a state in another level      transition.Transition

Order: excitation, transitions.
"""
