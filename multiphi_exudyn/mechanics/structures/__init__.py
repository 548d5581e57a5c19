"""Structures: M, C, K with named points, given, by their modes, or assembled from others.

Order: arguments, dofs, damping, point_rows, structure, condensed_structure, assembly, modal_structure.
"""
