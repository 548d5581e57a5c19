"""The matrix exponential in long double, by a Taylor series over a short time, squared."""

import numpy as np


def long_expm(system):
    """exp of a matrix (n, n)."""
    n = len(system)
    halved = max(0, int(np.ceil(np.log2(np.max(np.sum(np.abs(system), axis=1))))) + 2)
    step, term = np.eye(n, dtype=np.longdouble), np.eye(n, dtype=np.longdouble)
    for k in range(1, 20):
        term = term @ system / (2**halved * k)
        step += term
    for _ in range(halved):
        step = step @ step
    return step.astype(float)
