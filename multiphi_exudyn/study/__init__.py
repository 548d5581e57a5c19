"""Scenes, runs of their models, and what comes out of comparing them.

Order: scene, running, measures, sweep, comparison, accuracy, stability.
"""
