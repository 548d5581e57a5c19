"""Structure: an Exudyn system, or a finite element model in Exudyn, as a linear structure.

Order: fem_interface, system_matrices, linearized_structure, linearize.
"""
