"""Mathematics of matrices and functions of time for the method; it does not depend on structures.

Modes, and motions as sums of exponentials; functions of time as piecewise exponentials and as pieces of straight lines;
least distances, and how many answers an impact with friction has; orthonormal vectors; round-off.

Order: blas_threads, bounded_cache, round_off, orthonormal, exponentials, stiffness_digits, massless_motions, modes,
lowest_modes, least_distance, coulomb_impacts, interpolation, piecewise_exponential, piecewise_linear_fit.
"""
