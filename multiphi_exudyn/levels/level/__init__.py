"""Level: the linear system of one set of closed contacts, its modes and its static response.

Order: mode_figure, level_override, level.
"""
