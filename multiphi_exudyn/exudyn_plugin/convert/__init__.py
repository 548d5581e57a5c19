"""Conversion: an Exudyn system, or a finite element model in Exudyn, as a linear structure with contacts.

The system is linearised at its current state; what it holds is taken over, made a load or a contact, or said to be left
out. How far a reduced motion stays where that holds is checked against the system itself.

Order: directions, items, item_fates, geometric_stiffness, full_system, timed_loads, linearisation, matrix_checks,
point_rows, moved, frictions, contacts, fem_interface, system_matrices, linearized_structure, linearize, range_check,
linear_range, reduction, reduce.
"""
