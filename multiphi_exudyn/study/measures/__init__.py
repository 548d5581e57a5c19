"""How two answers differ: every measure in one place.

Order: metrics, spectra, response_frequencies, apparent_frequencies, shaker_test, stiff_stops, measures.
"""
