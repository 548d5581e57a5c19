"""Scenes, runs of their models, and what comes out of comparing them."""
