"""Linearisation: M, C, K and loads of an Exudyn system about its current state.

Order: geometric_stiffness, full_system, timed_loads, linearisation, matrix_checks.
"""
