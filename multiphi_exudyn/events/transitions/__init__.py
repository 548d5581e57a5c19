"""Transitions: the states of a motion, the ways out of them (exits), and the maps from one level into another (38.6).

Order: transition, defect_forms, state, exits, loaded_levels.
"""
