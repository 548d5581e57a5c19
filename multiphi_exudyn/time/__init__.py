"""Time: runs from event to event, and the trajectories they leave; there is no time step.

A motion advances a state, segment by segment, in the loop on flat arrays, compiled or plain, under loads that are
constant or vary in time. A record keeps what the loop has done; a trajectory samples it and sums its works, as far as
the loop has not, by the loop's own flow. What its truncated modes could not hold, and what to distrust in it, is read
off it.

Order: warning_groups, base_share, looking, verdict, flow, quadrature, segment, level_rows, balance, history_figure,
histories, resuming, sampling, work_sums, work_terms, work, growing, taken, record, recorded, saved_arrays, saved,
setting_out, start, model_histories, ending, trajectory, defects, truncation, chatter, loop_record, loop, going_on,
failures, motion, refinement, rubbing, rough_impacts, known_warnings, left_out, reliability, carrying, several,
simulate, workers, many.
"""
