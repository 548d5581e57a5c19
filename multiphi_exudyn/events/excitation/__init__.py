"""Excitation: what varies in time in a run, as channels, and a level under it.

Order: load_channels, excitation, pieces, channels, loaded_level.
"""
