"""Ahead: a body on which nothing of the system acts follows a motion that is computed in advance.

Order: undisturbed_steps, known_motion, event_steps, run_ahead.
"""
