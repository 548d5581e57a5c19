"""Levels: for every set of closed contacts the linear system that holds, in its own modes (eqs. 38.2 to 38.5).

The modal base makes every level a small dense problem. A level has modes and an asymptotic configuration, its static
response to gaps and loads. The model builds levels as they are needed, chooses their number of modes, and finds static
equilibria. Where the equations are stated:

    (38.2)  x = Phi_l eta, mass-normalised modes          level/level_modes.level_modes; level/level.Level.shapes
    (38.3)  the modal equations of motion                 level/build_level.build_level: squares, damping
    (38.4)  x = Phi_l eta + x_inf,l                       level/level.Level.asymptotic
    (38.5)  x_inf,l of gaps and loads                     level/static_response.static_response

Their solution in time is core/response.hpp, of loads that vary core/forced_response.hpp.

Order: base, level, equilibrium, model, core_model.
"""
