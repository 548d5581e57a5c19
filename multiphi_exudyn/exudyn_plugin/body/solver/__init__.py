"""Solver: the events of all bodies of a system after a step, and what the bodies need of Exudyn's solver.

Order: static_solution, switching, run_checks, solving.
"""
