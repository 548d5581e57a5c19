"""Body: a reduced model as an object of an Exudyn system, with its sensors, its drawing and its checks of the solver.

A body on which nothing of the system acts is told from a motion that is known beforehand. Beside others, a certified
test says after every step whether a contact can have asked to change; if so, the step is done again exactly, from event
to event. One function switches the levels of all bodies of a system.

Order: switching, run_record, level_data, coordinates, run_checks, undisturbed_steps, known_motion, certified_step,
own_loads, stops, run_ahead, start_state, surroundings, exact_step, step_by_step, body, rebuilt, sensors, drawing,
binding, solving, create.
"""
