"""Steady states: motions that repeat with a harmonic load, found on the map of one period.

A frequency response is made of many of them, one after the other.

Order: settled_state, shooting, settling, steady_state, frequency_response.
"""
