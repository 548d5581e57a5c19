"""Time: runs from event to event, and their trajectories; there is no time step.

Loads that vary are channels (excitation), and levels under them have these as coordinates. A motion advances a state,
segment by segment, in the core, under loads that are constant or vary in time. A record keeps the segments and events
of the core; a trajectory samples them, and sums the works that the core has left out. The effect of truncation and the
warnings of a run are computed from its trajectory.

Order: excitation, loaded_level, state, loaded_levels, segments, record, model_warnings, start, ledger, histories,
saved, mesh_output, trajectory, motion, continuation, law_warnings, contact_warnings, truncation, run_warnings,
simulate, many.
"""
