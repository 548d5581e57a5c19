"""Mechanics: the description of a structure, its contacts, friction and force laws, and the loads on it.

A structure is M, C, K and named points, given as matrices or by its modes, read from files, built as a beam, or
assembled from others. Nothing is reduced or solved here.

Order: arguments, dofs, damping, structure, assembly, condensed_structure, modal_structure, beam, element, contact,
residual_contact, friction, force_law, element_table, time_functions, loads, files.
"""
