"""Loads by their carrier's rate [1/s], the horizon [s] of a piece and its degree, for tests of responses to them."""

CARRIERS = [
    (0.0, 0.01, 1),  # samples, close together
    (0.0, 5.0, 8),
    (1j, 30.0, 0),  # resonance
    (1j * (1 + 1e-9), 30.0, 0),  # as good as resonance
    (5j, 3.0, 2),
    (25j, 0.3, 8),
    (-1 + 3j, 2.0, 4),
    (300j, 0.2, 8),
]
