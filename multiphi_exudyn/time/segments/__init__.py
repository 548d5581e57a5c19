"""Segments: the motion between two events, as sums of exponentials, and quantities computed from it.

Order: segment_flow, quadrature, segment, level_rows.
"""
