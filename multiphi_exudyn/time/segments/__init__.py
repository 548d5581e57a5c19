"""Segments: the motion between two events, as sums of exponentials, and what is read from it.

Order: segment_flow, quadrature, segment, level_rows.
"""
