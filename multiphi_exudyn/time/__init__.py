"""Time: runs from event to event, and their trajectories; there is no time step.

A motion advances a state, segment by segment, in the loop on flat arrays, compiled or plain, under loads that are
constant or vary in time. A record keeps the segments and events of the loop; a trajectory samples them, and sums the
works that the loop has left out, with the flow of the loop. The effect of truncation and the warnings of a run are
computed from its trajectory.

Order: warnings, loop, segments, record, trajectory, reliability, run, simulate, many.
"""
