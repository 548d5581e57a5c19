"""Runs under loads, stops and bases that vary in time: the same method with what varies as coordinates of its own.

Order: excitation, level, flow, state, segment, record, rule, arrays, motion, refinement.
"""
