"""One rigid contact with Coulomb friction that stays closed, step by step with matrix exponentials.

M x'' + C x' + K x = f(t) + h N - h_t T,   h.x = -gap,   slip: T = s mu N, s (h_t.x' - v) >= 0;   stick: h_t.x' = v
"""

import numpy as np
from stepwise import ROUND_OFF, Stepwise

__all__ = ["RoughFloor"]


class RoughFloor(Stepwise):
    """The motion beside ``contact`` until it would open; a phase: slip s, or stick, s = 0."""

    def __init__(self, structure, contact, loads=(), step=1e-3):
        super().__init__(structure, loads, step)
        self.contact = contact
        self.normal, self.tangent = structure.row(contact.direction), structure.row(contact.tangential)
        self.forces = {s: self.needed(s) for s in (-1, 0, 1)}

    def pushes(self, s):
        """Forces (k, n) on the structure by a unit of N, and of T where it sticks."""
        h, t, mu = self.normal, self.tangent, self.contact.friction
        return (h - s * mu * t)[None] if s else np.stack([h, -t])

    def needed(self, s):
        """N and T (2, m) as rows of z."""
        held = self.normal[None] if s else np.stack([self.normal, self.tangent])
        found = -np.linalg.solve(held @ self.inverse @ self.pushes(s).T, held @ self.inverse @ self.force)
        return np.stack([found[0], s * self.contact.friction * found[0] if s else found[1]])

    def system(self, s):
        """A with the forces of the contact."""
        normal, tension = self.forces[s]
        return self.with_forces(np.outer(self.normal, normal) - np.outer(self.tangent, tension))

    def slip(self, z):
        return self.tangent @ z[self.n : 2 * self.n] - self.contact.tangential_velocity

    def pressed(self, s, z):
        return self.forces[s][0] @ z

    def after(self, s, z):
        """What the contact does at z: as before where its signal is round-off."""
        self.largest = np.maximum(self.largest, np.abs(z))
        if s:
            size = np.abs(self.tangent) @ self.largest[self.n : 2 * self.n] + abs(self.contact.tangential_velocity)
            return s if s * self.slip(z) >= -ROUND_OFF * size else 0
        normal, tension = self.forces[0]
        bound = self.contact.friction * normal
        for way in (1, -1):
            if (way * tension - bound) @ z > ROUND_OFF * ((np.abs(tension) + np.abs(bound)) @ self.largest):
                return way
        return 0

    def first(self, z):
        """Slip or stick at the start: where stick would need too much, it slips that way."""
        size = np.abs(self.tangent) @ np.abs(z[self.n : 2 * self.n]) + abs(self.contact.tangential_velocity)
        return int(np.sign(self.slip(z))) if abs(self.slip(z)) > ROUND_OFF * size else self.after(0, z)

    def entered(self, s, z):
        """Where its slip ends it sticks, or reverses."""
        return self.after(0, z)

    def run(self, steps, x, v):
        """x, x' (2 n, k + 1) at multiples of the step until the contact opens, and how often it changed."""
        z, changes = self.start(x, v), 0
        self.largest = np.abs(z)
        s, values = self.first(z), [z[: 2 * self.n]]
        for _ in range(steps):
            z, s, more = self.advance(s, z)
            changes += more
            if not self.pressed(s, z) > 0:
                break
            values.append(z[: 2 * self.n])
        return np.array(values).T, changes
