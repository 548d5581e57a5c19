"""Record: segments and events of a run, copied out of the loop's arrays; samples, and works that the loop left out.

Order: segment_restart, sampling, work_terms, work, growing_array, loop_copies, record, recorded_segments.
"""
