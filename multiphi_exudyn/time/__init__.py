"""Time: runs from event to event, and the trajectories they leave; there is no time step.

A motion advances a state, segment by segment, in the loop on flat arrays, compiled or plain, under loads that are
constant or vary in time. A record keeps what the loop has done; a trajectory samples it and sums its works, as far as
the loop has not, by the loop's own flow. What its truncated modes could not hold, and what to distrust in it, is read
off it.

Order: warnings, loop, segments, record, trajectory, reliability, run, simulate, many.
"""
