"""Coupling: a level as Exudyn's solver takes it, and what an Exudyn system does to it at the points of the structure.

A level is matched to the solver's time step. Interface coordinates are points on which connectors, loads and
constraints of the system act; masses and constraints there take part in impacts; the system's matrices say which those
are.

Order: stepped_level, modal_force, exact_motion, attached_inertia, interface_nodes, interface, system_matrices.
"""
