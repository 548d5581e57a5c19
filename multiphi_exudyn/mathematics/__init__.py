"""Mathematics: what the method computes with, of matrices and functions of time; it knows no structure.

Modes and their exact free and forced response as sums of exponentials; the certified search for the instant at which
such a sum first falls through zero; functions of time as piecewise exponentials and as pieces of straight lines; the
shortest vector that linear inequalities allow; what round-off is; functions on flat buffers, compiled or plain.

Order: round_off, bounded_cache, flat_function, machine_code, compilation, compiled_cache, compiled, modes,
exponentials, flat_basis, free_response, forced_response, flat_response, root_search, first_descent, signal_bounds,
suspect, block_search, zero_crossing, least_distance, flat_least_distance, corners, interpolation,
piecewise_exponential, piecewise_linear_fit.
"""
