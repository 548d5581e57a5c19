"""Steady states: motions that repeat with a harmonic load, from the map of one period.

A frequency response is a sequence of steady states.

Order: shooting, steady_state, frequency_response.
"""
