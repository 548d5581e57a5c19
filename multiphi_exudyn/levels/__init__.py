"""Levels: for every set of closed contacts the linear system that holds, in its own modes (eqs. 38.2 to 38.5).

The modal base makes every level a small dense problem. A level has modes and an asymptotic configuration, its static
response to gaps and loads. The core builds levels from the base as they are needed; the model chooses their number of
modes, and finds static equilibria. Where the equations are stated:

    (38.2)  x = Phi_l eta, mass-normalised modes          core/level_modes.hpp; level/level.Level.shapes
    (38.3)  the modal equations of motion                 core/modal_level.hpp; with friction core/sliding.hpp
    (38.4)  x = Phi_l eta + x_inf,l                       core/modal_level.hpp; of loads that vary core/channels.hpp
    (38.5)  x_inf,l of gaps and loads                     core/static_response.hpp
    (38.6)  a state in another level                      core/transition.hpp

Their solution in time is core/response.hpp, of loads that vary core/forced_response.hpp.

Order: base, level, equilibrium, model, core_model.
"""
