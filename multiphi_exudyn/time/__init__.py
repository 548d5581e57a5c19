"""Time: runs from event to event, and the trajectories they leave; there is no time step.

A motion advances a state, segment by segment, in NumPy or in the loop on flat arrays, compiled or plain, under constant
loads or driven by what varies in time. A trajectory keeps its segments; what its truncated modes
could not hold, and what to distrust in it, is read off it.

Order: warning_groups, segment, record, trajectory, defects, truncation, loop, motion, driven, loop_motion,
reliability, simulate.
"""
