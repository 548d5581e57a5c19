"""Linearisation: M, C, K and loads of an Exudyn system about its current state.

Order: geometric_stiffness, constraints, full_system, timed_loads, prescribed_motion, linearisation, matrix_checks,
start_state.
"""
