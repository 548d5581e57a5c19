"""Stability: a catalogue of extreme cases, every model run through each of them, and what each answer is worth."""
