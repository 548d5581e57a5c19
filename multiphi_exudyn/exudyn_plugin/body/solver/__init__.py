"""Solver: the events of all bodies of a system after a step, and what the bodies need of Exudyn's solver.

Order: switching, run_checks, solving.
"""
