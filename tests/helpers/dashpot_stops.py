"""Spring-dashpot stops step by step with matrix exponentials.

M x'' + C x' + K x = f(t) + sum_c h N,   N = k d + c d' where d = -(h.x + gap) > 0 and N > 0, else 0
"""

import numpy as np
from stepwise import ROUND_OFF, Stepwise

__all__ = ["DashpotStops"]

AWAY, PUSHES, INSIDE = 0, 1, 2  # INSIDE: within its stop, where the damper would pull


class DashpotStops(Stepwise):
    """The motion of a structure with contacts of finite stiffness; a phase: what each of them does."""

    def __init__(self, structure, contacts, loads=(), step=1e-3):
        super().__init__(structure, loads, step)
        self.rows = np.array([structure.row(c.direction) for c in contacts])
        self.gaps = np.array([c.gap for c in contacts])
        self.stiffness = np.array([c.stiffness for c in contacts])
        self.damping = np.array([c.damping for c in contacts])

    def system(self, phase):
        """A while the stops push that do."""
        n, forces = self.n, np.zeros_like(self.force)
        for i in np.flatnonzero(np.array(phase) == PUSHES):
            forces[:, :n] -= self.stiffness[i] * np.outer(self.rows[i], self.rows[i])
            forces[:, n : 2 * n] -= self.damping[i] * np.outer(self.rows[i], self.rows[i])
            forces[:, -1] -= self.rows[i] * self.stiffness[i] * self.gaps[i]
        return self.with_forces(forces)

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

    def after(self, phase, z):
        """What every stop does at z, as before where its signal is round-off."""
        depth, force = self.depths_and_forces(z)
        deep, pushed = depth > self.slack, force > self.force_slack
        left, pulled = depth < -self.slack, force < -self.force_slack
        from_away = np.where(deep, np.where(pulled, INSIDE, PUSHES), AWAY)
        from_pushes = np.where(pulled, np.where(deep, INSIDE, AWAY), PUSHES)
        from_inside = np.where(left, AWAY, np.where(pushed, PUSHES, INSIDE))
        return tuple(np.choose(phase, [from_away, from_pushes, from_inside]).tolist())

    def run(self, steps, x, v):
        """x, x' (2 n, steps + 1) at multiples of the step from x, x' (n,), and how often a stop changed."""
        z, changes = self.start(x, v), 0
        self.largest = np.zeros(2 * self.n)
        self.grow(z)
        depth, force = self.depths_and_forces(z)
        first = np.where(depth > 0, INSIDE, AWAY)
        first[(depth >= -self.slack) & (force > self.force_slack)] = PUSHES
        phase, values = tuple(first.tolist()), [z[: 2 * self.n]]
        for _ in range(steps):
            self.grow(self.halves(phase)[0] @ z)
            z, phase, more = self.advance(phase, z)
            changes += more
            values.append(z[: 2 * self.n])
        return np.array(values).T, changes
