"""Run: from a start in all coordinates to a motion that the loop carries, and how one goes on.

Order: start_projection, start, continuation, motion, refinement.
"""
