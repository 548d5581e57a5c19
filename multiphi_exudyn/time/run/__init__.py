"""Run: the start in all coordinates, the motion that the core advances, and the continuation of a run.

Order: start_projection, start, continuation, chatter, failures, motion, refinement.
"""
