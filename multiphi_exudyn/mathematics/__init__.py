"""Mathematics of matrices and functions of time for the method; it does not depend on structures.

Modes and their exact free and forced response as sums of exponentials; the certified search for the instant at which
such a sum first falls through zero; functions of time as piecewise exponentials and as pieces of straight lines; the
small complementarity problem of contact and friction; products of vectors; round-off; functions on flat buffers,
compiled or plain.

Order: blas_threads, bounded_cache, compiling, round_off, orthonormal, eigenproblems, response, search,
complementarity, functions.
"""
