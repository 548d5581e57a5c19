"""Spring-dashpot stops step by step with matrix exponentials: the law alone, no modes and no levels.

M x'' + C x' + K x = f(t) + sum_c h N,   N = k d + c d' where d = -(h.x + gap) > 0 and N > 0, else 0

z = (x, x', the loads as oscillators, 1) moves by z' = A z with one A for each set of stops that push; which of them do
depends on z alone. A step in which one begins or ends to push is halved until that instant.
"""

import numpy as np
from scipy.linalg import expm

__all__ = ["DashpotStops"]

HALVINGS = 36
ROUND_OFF = 1e-13  # of the largest terms so far
MOST_CHANGES = 50  # in a step
AWAY, PUSHES, INSIDE = 0, 1, 2  # INSIDE: within its stop, where the damper would pull


class DashpotStops:
    """The motion of a structure with contacts of finite stiffness; loads: ConstantLoad and HarmonicLoad."""

    def __init__(self, structure, contacts, loads=(), step=1e-3):
        self.structure, self.contacts, self.n, self.step = structure, contacts, structure.n, step
        self.rows = np.array([structure.row(c.direction) for c in contacts])
        self.gaps = np.array([c.gap for c in contacts])
        self.stiffness = np.array([c.stiffness for c in contacts])
        self.damping = np.array([c.damping for c in contacts])
        oscillators = [load for load in loads if hasattr(load, "amplitude")]
        n, m = self.n, 2 * self.n + 2 * len(oscillators) + 1
        inverse = np.linalg.inv(np.asarray(structure.mass))
        self.free = np.zeros((m, m))
        self.free[:n, n : 2 * n] = np.eye(n)
        self.free[n : 2 * n, :n] = -inverse @ np.asarray(structure.stiffness)
        if structure.damping is not None:
            self.free[n : 2 * n, n : 2 * n] = -inverse @ np.asarray(structure.damping)
        self.loads = np.zeros(m - 2 * n)
        self.loads[-1] = 1.0
        for load in loads:
            if load not in oscillators:
                self.free[n : 2 * n, -1] += inverse @ structure.row(load.at) * load.force
        for k, load in enumerate(oscillators):
            omega, at = 2 * np.pi * load.frequency_hz, 2 * n + 2 * k
            self.free[at, at + 1], self.free[at + 1, at] = -omega, omega
            self.free[n : 2 * n, at] += inverse @ structure.row(load.at) * load.amplitude
            self.loads[2 * k : 2 * k + 2] = np.cos(load.phase), np.sin(load.phase)
        self.inverse, self.kept = inverse, {}

    def system(self, pushing):
        """A while the stops (c,) push."""
        n, system = self.n, self.free.copy()
        for i in np.flatnonzero(pushing):
            push = self.inverse @ self.rows[i]
            system[n : 2 * n, :n] -= np.outer(push, self.stiffness[i] * self.rows[i])
            system[n : 2 * n, n : 2 * n] -= np.outer(push, self.damping[i] * self.rows[i])
            system[n : 2 * n, -1] -= push * self.stiffness[i] * self.gaps[i]
        return system

    def halves(self, pushing):
        """exp(A step / 2^k), k = 0, 1, ..."""
        key = tuple(pushing)
        if key not in self.kept:
            system = self.system(pushing)
            self.kept[key] = [expm(system * self.step / 2**k) for k in range(HALVINGS)]
        return self.kept[key]

    def depths_and_forces(self, z):
        """d and k d + c d' (c,)."""
        depth = -(self.rows @ z[: self.n] + self.gaps)
        return depth, self.stiffness * depth - self.damping * (self.rows @ z[self.n : 2 * self.n])

    def grow(self, z):
        """Let round-off follow the largest displacements and velocities so far."""
        self.largest = np.maximum(self.largest, np.abs(z[: 2 * self.n]))
        moved, moving = np.abs(self.rows) @ self.largest[: self.n], np.abs(self.rows) @ self.largest[self.n :]
        self.slack = ROUND_OFF * (moved + self.gaps)
        self.force_slack = self.stiffness * self.slack + ROUND_OFF * self.damping * moving

    def modes_after(self, modes, z):
        """What every stop does at z, as before where its signal is round-off."""
        depth, force = self.depths_and_forces(z)
        deep, pushed = depth > self.slack, force > self.force_slack
        left, pulled = depth < -self.slack, force < -self.force_slack
        from_away = np.where(deep, np.where(pulled, INSIDE, PUSHES), AWAY)
        from_pushes = np.where(pulled, np.where(deep, INSIDE, AWAY), PUSHES)
        from_inside = np.where(left, AWAY, np.where(pushed, PUSHES, INSIDE))
        return np.choose(modes, [from_away, from_pushes, from_inside])

    def holds(self, modes, z):
        """Whether every stop still does what it did."""
        return bool(np.all(self.modes_after(modes, z) == modes))

    def run(self, steps, x, v):
        """x, x' (2 n, steps + 1) at multiples of the step from x, x' (n,), and how often a stop changed."""
        z, changes = np.concatenate([x, v, self.loads]), 0
        self.largest = np.zeros(2 * self.n)
        self.grow(z)
        depth, force = self.depths_and_forces(z)
        modes = np.where(depth > 0, INSIDE, AWAY)
        modes[(depth >= -self.slack) & (force > self.force_slack)] = PUSHES
        values = np.zeros((2 * self.n, steps + 1))
        values[:, 0] = z[: 2 * self.n]
        for k in range(1, steps + 1):
            halves = self.halves(modes == PUSHES)
            reached = halves[0] @ z
            self.grow(reached)
            left = self.step
            for _ in range(MOST_CHANGES):
                if self.holds(modes, reached):
                    break
                for half, part in enumerate(halves[1:], 1):
                    trial = part @ z if self.step / 2**half <= left else None
                    if trial is not None and self.holds(modes, trial):
                        z, left = trial, left - self.step / 2**half
                beyond = max(half for half, part in enumerate(halves) if not self.holds(modes, part @ z))
                z, left = halves[beyond] @ z, max(left - self.step / 2**beyond, 0.0)
                after = self.modes_after(modes, z)
                changes += int(np.any(after != modes))
                modes, halves = after, self.halves(after == PUSHES)
                reached = expm(self.system(modes == PUSHES) * left) @ z
            else:
                raise ArithmeticError("the stops change without end")
            z = reached
            values[:, k] = z[: 2 * self.n]
        return values, changes
