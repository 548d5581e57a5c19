"""Beams: sections, Euler-Bernoulli elements, and a planar beam as a structure.

Order: section, beam, planar_beam.
"""
