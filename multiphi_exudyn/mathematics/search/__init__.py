"""Search: the first instant at which a signal falls through zero, certified: no crossing is stepped over.

Order: signal_bounds, hermite_root, doubtful_signal, block_search, signal_starts, zero_crossing.
"""
