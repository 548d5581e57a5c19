"""Base: the coordinates that all levels of a structure share, and the directions of closed contacts in them.

Order: stiffness_warnings, modal_base, build_base.
"""
