"""Record: what the loop has done, copied out of its arrays; its samples, and the works that the loop left out.

Order: segment_restart, sampling, work_terms, work, growing_array, loop_copies, record, recorded_segments.
"""
