"""Linear systems that switch, step by step with matrix exponentials: the law alone, no modes and no levels.

z = (x, x', the loads as oscillators, 1) moves by z' = A z with one A for each phase; which one holds depends on z
alone. A step in which a phase ends is halved until that instant.
"""

import numpy as np
from scipy.linalg import expm

__all__ = ["ROUND_OFF", "Stepwise"]

HALVINGS = 36
ROUND_OFF = 1e-13  # of the largest terms so far
MOST_CHANGES = 50  # in a step


class Stepwise:
    """A structure under ConstantLoad and HarmonicLoad; ``system`` and ``after`` say what switches.

    free: A (m, m) of x' = v and of the oscillators. force: f(t) - K x - C x' (n, m) as rows of z. loads: at t = 0.
    """

    def __init__(self, structure, loads, step):
        self.n, self.step, self.kept = structure.n, step, {}
        oscillators = [load for load in loads if hasattr(load, "amplitude")]
        n, m = self.n, 2 * self.n + 2 * len(oscillators) + 1
        self.inverse, self.free = np.linalg.inv(np.asarray(structure.mass)), np.zeros((m, m))
        self.free[:n, n : 2 * n] = np.eye(n)
        self.force, self.loads = np.zeros((n, m)), np.zeros(m - 2 * n)
        self.force[:, :n] = -np.asarray(structure.stiffness)
        if structure.damping is not None:
            self.force[:, n : 2 * n] = -np.asarray(structure.damping)
        self.loads[-1] = 1.0
        for load in loads:
            if load not in oscillators:
                self.force[:, -1] += structure.row(load.at) * load.force
        for k, load in enumerate(oscillators):
            omega, at = 2 * np.pi * load.frequency_hz, 2 * n + 2 * k
            self.free[at, at + 1], self.free[at + 1, at] = -omega, omega
            self.force[:, at] += structure.row(load.at) * load.amplitude
            self.loads[2 * k : 2 * k + 2] = np.cos(load.phase), np.sin(load.phase)

    def start(self, x, v):
        """z at t = 0."""
        return np.concatenate([x, v, self.loads])

    def with_forces(self, forces):
        """A (m, m) under forces (n, m) on the structure, given as rows of z, besides its own."""
        system = self.free.copy()
        system[self.n : 2 * self.n] = self.inverse @ (self.force + forces)
        return system

    def system(self, phase):
        """A (m, m) of a phase."""
        raise NotImplementedError

    def after(self, phase, z):
        """The phase that holds at z, where ``phase`` has held before."""
        raise NotImplementedError

    def entered(self, phase, z):
        """The phase that follows at z, where ``phase`` has ended."""
        return self.after(phase, z)

    def halves(self, phase):
        """exp(A step / 2^k), k = 0, 1, ..."""
        if phase not in self.kept:
            system = self.system(phase)
            self.kept[phase] = [expm(system * self.step / 2**k) for k in range(HALVINGS)]
        return self.kept[phase]

    def advance(self, phase, z):
        """z and the phase after a step, and how often it has changed."""
        reached, left, changes = self.halves(phase)[0] @ z, self.step, 0
        for _ in range(MOST_CHANGES):
            if self.after(phase, reached) == phase:
                return reached, phase, changes
            halves = self.halves(phase)
            for half, part in enumerate(halves[1:], 1):
                trial = part @ z if self.step / 2**half <= left else None
                if trial is not None and self.after(phase, trial) == phase:
                    z, left = trial, left - self.step / 2**half
            beyond = max(half for half, part in enumerate(halves) if self.after(phase, part @ z) != phase)
            z, left = halves[beyond] @ z, max(left - self.step / 2**beyond, 0.0)
            before, phase = phase, self.entered(phase, z)
            changes += phase != before
            reached = expm(self.system(phase) * left) @ z
        raise ArithmeticError("the phases change without end")
