"""Excitation: what varies in time in a run, as channels, and a level under it.

Order: load_channels, excitation, channels, loaded_level.
"""
