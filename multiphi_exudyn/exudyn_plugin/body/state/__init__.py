"""State: the coordinates of a body in Exudyn's vectors, in its data node and in its level.

Order: run_record, level_data, coordinates, step_errors.
"""
