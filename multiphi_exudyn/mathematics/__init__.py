"""Mathematics: what the method computes with, of matrices and functions of time; it knows no structure.

Modes and their exact free and forced response as sums of exponentials; the certified search for the instant at which
such a sum first falls through zero; functions of time as piecewise exponentials and as pieces of straight lines; the
small complementarity problem of contact and friction; what round-off is; functions on flat buffers, compiled or plain.

Order: bounded_cache, buffer_function, machine_code, translation, compilation, compiled_cache, compiled, round_off,
orthonormal, inner_products, modes, lanczos, lowest_modes, secular_equation, exponentials, basis_arrays, free_response,
light_damping, motion_parts, coupled_response, forced_response, forced_orders, response_arrays, signal_bounds,
hermite_root, suspect, block_search, signal_starts, zero_crossing, least_distance, free_rows, row_sides,
complementarity, coulomb_impacts, corners, interpolation, piecewise_exponential, piecewise_linear_fit.
"""
