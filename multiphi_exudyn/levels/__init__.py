"""Levels: for every set of closed contacts the linear system that holds, in its own modes (eqs. 38.2 to 38.5).

The modal base makes every level a small dense problem. A level has modes and an asymptotic configuration, its static
response to gaps and loads. The model builds levels as they are needed, chooses their number of modes, and finds static
equilibria. Where the equations are stated:

    (38.2)  x = Phi_l eta, mass-normalised modes          level_modes.level_modes; level.Level.shapes
    (38.3)  the modal equations of motion                 build_level.build_level: squares, damping
    (38.4)  x = Phi_l eta + x_inf,l                       level.Level.asymptotic
    (38.5)  x_inf,l of gaps and loads                     static_response.static_response

Their solution in time is mathematics/response/free_response.py, of loads that vary
mathematics/response/forced_response.py.

Order: closed_directions, modal_base, build_base, static_response, level_modes, mode_figure, level_override, level,
build_level, sliding, sliding_equilibrium, static_equilibrium, equilibrium_under_forces, mode_choice, level_store,
shared_base, model_arguments, model.
"""
