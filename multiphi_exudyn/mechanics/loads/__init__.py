"""Loads: forces and motions of supports as functions of time.

Order: samples, time_functions, static_loads, moving_supports, loads.
"""
