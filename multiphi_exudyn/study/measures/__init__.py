"""How two answers differ: every measure in one place.

Order: metrics, spectra, shaker_test, stiff_stops, measures.
"""
