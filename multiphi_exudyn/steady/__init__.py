"""Steady states: motions that repeat with a harmonic load, found on the map of one period.

A frequency response is made of many of them, one after the other.

Order: shooting, steady_state, frequency_response.
"""
