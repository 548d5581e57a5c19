"""Complementarity: where the small problem of contact and friction stands in Python (core/complementarity.hpp).

Order: least_distance, coulomb_impacts.
"""
