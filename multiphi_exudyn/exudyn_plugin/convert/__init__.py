"""Conversion: an Exudyn system, or a finite element model in Exudyn, as a linear structure with contacts.

The system is linearised at its current state. Each of its items becomes a part of the matrices, a load or a contact, or
is left out for a stated reason. The system itself gives the error of the linearisation in a reduced motion.

Order: directions, items, item_fates, geometric_stiffness, full_system, timed_loads, linearisation, matrix_checks,
point_rows, moved_directions, frictions, contacts, fem_interface, system_matrices, linearized_structure, linearize,
range_check, linear_range, reduction, reduce.
"""
