"""Run: the start in all coordinates, the motion that the loop advances, and the continuation of a run.

Order: start_projection, start, continuation, motion, refinement.
"""
