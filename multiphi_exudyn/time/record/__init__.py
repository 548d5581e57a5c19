"""Record: segments and events of a run, which the core keeps; samples, and works that its loop left out.

Order: record, recorded_segments.
"""
