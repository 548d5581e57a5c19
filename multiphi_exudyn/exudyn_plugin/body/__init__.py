"""Body: a reduced model as an object of an Exudyn system, with its sensors, its drawing and its checks of the solver.

A body on which nothing of the system acts follows a motion that is computed in advance. A body beside others is tested
after every step: if an event may have occurred, the step is computed again exactly, from event to event. One PostStep
function handles the events of all bodies of a system.

Order: state, solver, stepping, ahead, body, results, binding, create.
"""
