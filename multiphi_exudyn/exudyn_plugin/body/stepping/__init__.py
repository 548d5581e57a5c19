"""Stepping: a body beside others is tested after every step, and computed again exactly where an event may be.

Order: certified_step, own_loads, start_state, surroundings, exact_step, step_by_step.
"""
