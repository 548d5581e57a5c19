"""One rigid contact with Coulomb friction that stays closed, step by step with matrix exponentials: the law alone.

M x'' + C x' + K x = f(t) + h N - h_t T,   h.x = -gap,   slip: T = s mu N, s (h_t.x' - v) >= 0;   stick: h_t.x' = v

z = (x, x', the loads as oscillators, 1) moves by z' = A z with one A for stick and one for each direction of slip.
"""

import numpy as np
from scipy.linalg import expm

__all__ = ["RoughFloor"]

HALVINGS = 36
ROUND_OFF = 1e-13  # of the largest terms so far
MOST_CHANGES = 50  # in a step


class RoughFloor:
    """The motion beside ``contact`` until it would open; loads: ConstantLoad and HarmonicLoad."""

    def __init__(self, structure, contact, loads=(), step=1e-3):
        self.n, self.contact, self.step = structure.n, contact, step
        self.normal, self.tangent = structure.row(contact.direction), structure.row(contact.tangential)
        oscillators = [load for load in loads if hasattr(load, "amplitude")]
        n, m = self.n, 2 * self.n + 2 * len(oscillators) + 1
        self.inverse, self.motion = np.linalg.inv(np.asarray(structure.mass)), np.zeros((m, m))
        self.motion[:n, n : 2 * n] = np.eye(n)
        self.force, self.loads = np.zeros((n, m)), np.zeros(m - 2 * n)  # f(t) - K x - C x'
        self.force[:, :n] = -np.asarray(structure.stiffness)
        if structure.damping is not None:
            self.force[:, n : 2 * n] = -np.asarray(structure.damping)
        self.loads[-1] = 1.0
        for load in loads:
            if load not in oscillators:
                self.force[:, -1] += structure.row(load.at) * load.force
        for k, load in enumerate(oscillators):
            omega, at = 2 * np.pi * load.frequency_hz, 2 * n + 2 * k
            self.motion[at, at + 1], self.motion[at + 1, at] = -omega, omega
            self.force[:, at] += structure.row(load.at) * load.amplitude
            self.loads[2 * k : 2 * k + 2] = np.cos(load.phase), np.sin(load.phase)
        self.kept = {s: self.level(s) for s in (-1, 0, 1)}

    def level(self, s):
        """A, N and T as rows of z, and exp(A step / 2^k), with slip s or stick, s = 0."""
        h, t, mu = self.normal, self.tangent, self.contact.friction
        held = h[None] if s else np.stack([h, t])
        pushes = (h - s * mu * t)[None] if s else np.stack([h, -t])
        forces = -np.linalg.solve(held @ self.inverse @ pushes.T, held @ self.inverse @ self.force)
        system = self.motion.copy()
        system[self.n : 2 * self.n] = self.inverse @ (self.force + pushes.T @ forces)
        tension = s * mu * forces[0] if s else forces[1]
        return system, forces[0], tension, [expm(system * self.step / 2**k) for k in range(HALVINGS)]

    def slip(self, z):
        return self.tangent @ z[self.n : 2 * self.n] - self.contact.tangential_velocity

    def pressed(self, s, z):
        return self.kept[s][1] @ z

    def after(self, s, z):
        """What the contact does at z: as before where its signal is round-off."""
        self.largest = np.maximum(self.largest, np.abs(z))
        if s:
            size = np.abs(self.tangent) @ self.largest[self.n : 2 * self.n] + abs(self.contact.tangential_velocity)
            return s if s * self.slip(z) >= -ROUND_OFF * size else 0
        _, normal, tension, _ = self.kept[0]
        bound = self.contact.friction * normal
        for way in (1, -1):
            if (way * tension - bound) @ z > ROUND_OFF * ((np.abs(tension) + np.abs(bound)) @ self.largest):
                return way
        return 0

    def first(self, z):
        """Slip or stick at the start: where stick would need too much, it slips that way."""
        size = np.abs(self.tangent) @ np.abs(z[self.n : 2 * self.n]) + abs(self.contact.tangential_velocity)
        return int(np.sign(self.slip(z))) if abs(self.slip(z)) > ROUND_OFF * size else self.after(0, z)

    def run(self, steps, x, v):
        """x, x' (2 n, k + 1) at multiples of the step until the contact opens, and how often it changed."""
        z, changes = np.concatenate([x, v, self.loads]), 0
        self.largest = np.abs(z)
        s = self.first(z)
        values = [z[: 2 * self.n]]
        for _ in range(steps):
            halves, left = self.kept[s][3], self.step
            reached = halves[0] @ z
            for _ in range(MOST_CHANGES):
                if self.after(s, reached) == s:
                    break
                for half, part in enumerate(halves[1:], 1):
                    trial = part @ z if self.step / 2**half <= left else None
                    if trial is not None and self.after(s, trial) == s:
                        z, left = trial, left - self.step / 2**half
                beyond = max(half for half, part in enumerate(halves) if self.after(s, part @ z) != s)
                z, left = halves[beyond] @ z, max(left - self.step / 2**beyond, 0.0)
                changes += 1
                s = self.after(0, z)  # where its slip ends it sticks, or reverses
                halves = self.kept[s][3]
                reached = expm(self.kept[s][0] * left) @ z
            else:
                raise ArithmeticError("the contact changes without end")
            if not self.pressed(s, reached) > 0:
                break
            z = reached
            values.append(z[: 2 * self.n])
        return np.array(values).T, changes
