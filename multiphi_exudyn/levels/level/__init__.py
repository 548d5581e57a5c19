"""Level: the linear system of one set of closed contacts, its modes and its static response.

Order: static_response, level_modes, mode_figure, level_override, level, level_rows, build_level,
sliding, quasi_static, residual_level.
"""
