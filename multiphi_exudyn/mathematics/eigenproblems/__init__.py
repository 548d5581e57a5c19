"""Eigenproblems: natural frequencies and M-orthonormal modes of dense, sparse and nearly diagonal matrices.

Order: massless_motions, inner_products, modes, lanczos, lowest_modes, secular_equation.
"""
