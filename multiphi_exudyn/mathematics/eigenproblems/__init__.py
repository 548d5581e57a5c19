"""Eigenproblems: natural frequencies and M-orthonormal modes of dense, sparse and nearly diagonal matrices.

Order: stiffness_digits, massless_motions, inner_products, modes, lanczos, lowest_modes.
"""
