"""Coupling: the equations of a level for Exudyn's solver, and forces and inertia of the system at points of the body.

The modes of a level are matched to the solver's time step. Interface coordinates are points on which connectors, loads
and constraints of the system act. Masses and constraints there take part in impacts; they follow from the system's
matrices.

Order: stepped_level, modal_force, exact_motion, attached_inertia, interface_nodes, interface, system_matrices.
"""
