"""Mechanics: the description of a structure, its contacts, friction and force laws, and the loads on it.

A structure is M, C, K and named points, given as matrices or by its modes, read from files, built as a beam, or
assembled from others. Nothing is reduced or solved here.

Order: arguments, dofs, damping, point_rows, structure, assembly, text_matrices, array_files, matrix_files,
modal_structure, section, beam, planar_beam, element, contact, friction, law_lines, force_law, element_table,
samples, time_functions, static_loads, moving_supports, loads.
"""
