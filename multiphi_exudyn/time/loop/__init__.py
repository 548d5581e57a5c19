"""Loop: a run from event to event on flat arrays, what it records and adds up on its way, and how it may fail.

Order: motion_size, verdict, work_sums, chatter, loop_record, run_start, loop, failures.
"""
