"""Unstable directions of a linearised system in which nothing moves it: a model may hold them, and says so.

    K u = s M u, s < 0,   u.p = 0 for every push p,   w.C u = 0 for every other mode w

A mass on a compressed spring is unstable sideways, and moves along the spring alone as long as nothing pushes it aside,
in Exudyn's own run too. Pushes (k, n) [N, N m] are what can: forces, momenta, contacts, loads. All in the coordinates z
(n,) of the free directions; held are those with u.M z = 0 left.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

__all__ = ["stable_directions"]

IDLE = 1e-7  # of a push: what differentiating leaves of it where there is none
UNSTABLE = 1e-12  # of the largest omega^2: a negative one that is no round-off


def stable_directions(
    mass: np.ndarray, stiffness: np.ndarray, damping: np.ndarray, pushes: np.ndarray
) -> np.ndarray | None:
    """Q (n, m), orthonormal, without the unstable modes; None if a push moves them, or nothing is left."""
    squares, shapes = scipy.linalg.eigh((stiffness + stiffness.T) / 2, mass)
    unstable = squares < -UNSTABLE * np.max(np.abs(squares))
    pushed, damped = pushes @ shapes, shapes.T @ damping @ shapes
    moved = np.abs(pushed[:, unstable]) > IDLE * np.linalg.norm(pushed, axis=1, keepdims=True)
    coupled = np.abs(damped[~unstable][:, unstable]) > IDLE * np.max(np.abs(damped), initial=0.0)
    if np.all(unstable) or np.any(moved) or np.any(coupled):
        return None
    return np.asarray(scipy.linalg.null_space((mass @ shapes[:, unstable]).T))
