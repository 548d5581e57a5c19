"""Complementarity: the small problem of contact and friction, lo <= z <= hi complementary to W z + b.

Order: least_distance, free_rows, row_sides, principal_pivoting, coulomb_impacts.
"""
