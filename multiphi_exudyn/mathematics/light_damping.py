"""Free response of oscillating modes that damping couples lightly: what each has of the others, by iteration.

    (lambda^2 + lambda D + diag(omega^2)) v = 0,   D = diag(d) + G symmetric,   v_i = 1 in pair i

From v = e_i, every row j gives its component, and row i the rate:

    v_j = -lambda (G v)_j / (omega_j^2 - omega_i^2 + lambda (d_j - d_i - (G v)_i)),   j not i
    lambda^2 + lambda (d_i + (G v)_i) + omega_i^2 = 0

all pairs at once. It converges by the factor that damping is of the distance of two modes. As D is symmetric, the
same vectors make the motion of a start (F. Tisseur, K. Meerbergen, The quadratic eigenvalue problem, SIAM Rev. 43
(2001) 235, sec. 3):

    eta(t) = Re sum_i v_i c_i exp(lambda_i t),   c_i = 2 v_i . (eta'(0) - omega^2 eta(0) / lambda_i) / theta_i
    theta_i = v_i . (2 lambda_i + D) v_i
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.mathematics.free_response import ModalResponse

__all__ = ["lightly_damped"]

LIGHT = 0.2  # of omega, and of a distance of two modes: more damping is not light
SYMMETRIC = 1e-13  # of the largest damping: round-off of a symmetric matrix
LAST = 2e-16  # of a mode: the step after the last, if it is as much smaller as the least of those before
MOST_STEPS = 30  # of the iteration; three to ten are typical


def lightly_damped(squares: np.ndarray, damping: np.ndarray) -> ModalResponse | None:
    """Closed form for omega^2 (r,) and damping D (r, r); None where D is not symmetric, or not light."""
    omega, own = np.sqrt(np.maximum(squares, 0.0)), damping.diagonal()
    mixed, transposed = damping.copy(), damping.T
    if not (np.abs(own) < LIGHT * omega).all() or np.abs(damping - transposed).max() > SYMMETRIC * own.max():
        return None
    each = slice(None, None, len(omega) + 1)  # the diagonal of a flat matrix
    apart = (omega[:, None] - omega) * (omega[:, None] + omega)
    mixed.flat[each], apart.flat[each] = 0.0, np.inf
    if not (np.abs(mixed).sum(axis=1)[:, None] * omega <= LIGHT * np.abs(apart)).all():
        return None
    vectors, moved, before, falls = np.eye(len(omega), dtype=complex), mixed + 0j, 1.0, 0.0
    coupling, diagonal, parts = moved.copy(), moved.ravel()[each], vectors.view(float)
    for _ in range(MOST_STEPS):
        half = (own + diagonal) / 2
        rates = 1j * np.sqrt(squares - half * half) - half
        moved *= rates / ((own[:, None] - 2 * half) * rates + apart)
        diagonal[:] = -1.0
        vectors += moved
        step = float(np.abs(parts).max())
        np.negative(moved, out=vectors)
        before, falls = step, max(falls, step / before)
        if step * falls <= LAST:
            return _response(squares, damping, rates, vectors)
        np.matmul(coupling, vectors, out=moved)
    return None


def _response(squares: np.ndarray, damping: np.ndarray, rates: np.ndarray, vectors: np.ndarray) -> ModalResponse:
    """Closed form for rates (r,) and vectors v (r, r)."""
    r = len(rates)
    theta = ((2 * rates * vectors + damping @ vectors) * vectors).sum(axis=0)
    from_velocity = (2 / theta * vectors).T
    from_displacement = from_velocity * (squares / -rates[:, None])
    return ModalResponse(
        basis=Exponentials(rates, np.zeros(r, int)),
        shapes=vectors,
        from_displacement=from_displacement,
        from_velocity=from_velocity,
        from_force=np.zeros((r, r), complex),
        diagonal=False,
        alone=np.zeros(r, bool),
        poles=np.ones(r, bool),
    )
