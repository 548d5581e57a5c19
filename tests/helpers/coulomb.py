"""Compliant contacts with Coulomb friction, integrated from event to event: the law alone, no modes and no levels.

M x'' + C x' + K x = f(t) + sum_c (h N - h_t T),   N = -k (h.x + gap) - c h.x' where it is closed
stick   T = k_t (h_t.x - v t - w), or where k_t is infinite what keeps h_t.x' = v;   slip   T = s mu N
"""

import math

import numpy as np
from scipy.integrate import solve_ivp

__all__ = ["Coulomb"]

RTOL, ATOL = 1e-12, 1e-13
AWAY = 1e-6  # s after an event in which nothing is looked for: signals that begin at zero have a sign after it


class Coulomb:
    """The motion of ``structure`` with UnilateralContacts that have friction, from x, x' (n,); force: f(t) (n,)."""

    def __init__(self, structure, contacts, force=None, longest=0.02):
        self.n, self.contacts, self.longest = structure.n, contacts, longest
        self.inverse, self.stiffness = np.linalg.inv(np.asarray(structure.mass)), np.asarray(structure.stiffness)
        given = structure.damping
        self.damping = np.zeros_like(self.stiffness) if given is None else np.asarray(given)
        self.normals = [structure.row(c.direction) for c in contacts]
        self.tangents = [structure.row(c.tangential) for c in contacts]
        self.force = force or (lambda t: np.zeros(self.n))
        self.modes = ["open"] * len(contacts)
        self.places = np.zeros(len(contacts))

    def normal(self, i, z):
        c, h = self.contacts[i], self.normals[i]
        return -c.stiffness * (h @ z[: self.n] + c.gap) - c.damping * (h @ z[self.n :])

    def speed(self, i, z):
        return self.tangents[i] @ z[self.n :] - self.contacts[i].tangential_velocity

    def forces(self, t, z):
        """T (c,): of the rigid sticking ones the multipliers that keep their speed."""
        n, free = self.n, self.force(t) - self.stiffness @ z[: self.n] - self.damping @ z[self.n :]
        tensions, stuck = np.zeros(len(self.contacts)), []
        for i, (c, mode) in enumerate(zip(self.contacts, self.modes, strict=True)):
            if mode == "open":
                continue
            free = free + self.normals[i] * self.normal(i, z)
            if mode != "stick":
                tensions[i] = mode * c.friction * self.normal(i, z)
            elif math.isfinite(c.tangential_stiffness):
                tensions[i] = c.tangential_stiffness * (
                    self.tangents[i] @ z[:n] - c.tangential_velocity * t - self.places[i]
                )
            else:
                stuck.append(i)
            free = free - self.tangents[i] * tensions[i]
        if stuck:
            rows = np.array([self.tangents[i] for i in stuck])
            share = rows @ self.inverse
            tensions[stuck] = np.linalg.solve(share @ rows.T, share @ free)
            free = free - rows.T @ tensions[stuck]
        return tensions, free

    def slope(self, t, z):
        return np.concatenate([z[self.n :], self.inverse @ self.forces(t, z)[1]])

    def slip_end(self, i, sign):
        """s (h_t.x' - v - s mu N' / k_t), falling through zero."""
        c = self.contacts[i]

        def signal(t, z):
            rate = -c.stiffness * (self.normals[i] @ z[self.n :])
            return sign * self.speed(i, z) - c.friction * rate / c.tangential_stiffness

        return signal

    def slip_begin(self, i, sign):
        """mu_s N - s T, falling through zero."""
        return lambda t, z: self.contacts[i].most * self.normal(i, z) - sign * self.forces(t, z)[0][i]

    def signals(self):
        """(contact, what happens where the signal falls through zero, signal)."""
        found = []
        for i, (c, mode) in enumerate(zip(self.contacts, self.modes, strict=True)):
            if mode == "open":
                found.append((i, "close", lambda t, z, i=i, c=c: self.normals[i] @ z[: self.n] + c.gap))
                continue
            found.append((i, "open", lambda t, z, i=i: self.normal(i, z)))
            if mode == "stick":
                for s in (1, -1):
                    found.append((i, s, self.slip_begin(i, s)))
            else:
                found.append((i, "stick", self.slip_end(i, mode)))
        return found

    def begin(self, t, z, i):
        """The state in which contact i, which presses, goes on: what holds a moment later."""
        c = self.contacts[i]
        if math.isinf(c.tangential_stiffness):
            speed = self.speed(i, z)
            if abs(speed) > 1e-11:
                self.modes[i] = int(np.sign(speed))
                return
        self.modes[i] = "stick"
        self.settle(t, z, i)

    def settle(self, t, z, i):
        """Where stick would be beyond its limit, or is at it and goes beyond, it slips."""
        tension, pressed = self.forces(t, z)[0][i], self.normal(i, z)
        limit, size = self.contacts[i].most * pressed, abs(pressed) * self.contacts[i].most + abs(tension)
        if size < 1e-9:  # just closed: what grows faster
            ahead = z + 1e-6 * self.slope(t, z)
            tension, pressed = self.forces(t + 1e-6, ahead)[0][i], self.normal(i, ahead)
            limit, size = self.contacts[i].most * pressed, 0.0
        if abs(tension) > limit + 1e-9 * size:
            self.modes[i] = int(np.sign(tension))

    def change(self, t, z, i, what):
        c, before = self.contacts[i], self.modes[i]
        if what == "open":
            self.modes[i] = "open"
        elif what == "close":
            self.modes[i] = "stick"
            self.places[i] = self.tangents[i] @ z[: self.n] - c.tangential_velocity * t
            self.begin(t, z, i)
        elif what == "stick":
            stretch = before * c.friction * self.normal(i, z) / c.tangential_stiffness
            self.places[i] = self.tangents[i] @ z[: self.n] - c.tangential_velocity * t - stretch
            self.modes[i] = "stick"
            self.settle(t, z, i)
        else:
            self.modes[i] = what
            sprung = math.isfinite(c.tangential_stiffness)
            if sprung and c.most > c.friction and self.slip_end(i, what)(t, z) < 0:
                self.change(t, z, i, "stick")  # the force has fallen, and its patch would slide back

    def run(self, t_end, x, v, times):
        """x (n, k) at times, and (time, contact, kind) of every event."""
        t, z, events, away = 0.0, np.concatenate([x, v]), [], False
        values = np.zeros((self.n, len(times)))
        for i, c in enumerate(self.contacts):
            if self.normals[i] @ x + c.gap < 0 and self.normal(i, z) > 0:
                self.places[i] = self.tangents[i] @ x
                self.begin(0.0, z, i)
        while t < t_end:
            watched = self.signals()
            conditions = [signal for _, _, signal in watched] if away else None
            for condition in conditions or ():
                condition.terminal, condition.direction = True, -1.0
            found = solve_ivp(
                self.slope, (t, t_end if away else min(t + AWAY, t_end)), z, "DOP853", events=conditions, rtol=RTOL,
                atol=ATOL, max_step=self.longest, dense_output=True,
            )  # fmt: skip
            here = (times >= t) & (times <= found.t[-1])
            if np.any(here):
                values[:, here] = found.sol(times[here])[: self.n]
            t, z = float(found.t[-1]), found.y[:, -1]
            if found.status != 1:
                away = True
                continue
            away = False
            k = next(k for k, instants in enumerate(found.t_events) if len(instants))
            i, what, _ = watched[k]
            before = self.modes[i]
            self.change(t, z, i, what)
            if self.modes[i] != before:
                kind = what if what in ("open", "close") else "stick" if self.modes[i] == "stick" else "slip"
                events.append((t, i, kind))
        return values, events
