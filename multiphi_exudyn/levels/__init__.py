"""Levels: for every set of closed contacts the linear system that holds, in its own modes (eqs. 38.2 to 38.5).

The modal base makes every level a small dense problem. A level has modes and an asymptotic configuration, its static
response to gaps and loads. The model builds levels as they are needed, chooses their number of modes, and finds static
equilibria.

Order: closed_directions, modal_base, static_response, level_modes, level, build_level, static_equilibrium, mode_choice,
model.
"""
