"""Levels for brute force: the linear system of a state, its exact steps, and the motion inside a step."""

import functools
import itertools
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import expm

from brute_force.sliding import SIGNS, TIMED, Sliding

STEP = 0.35  # times the fastest rate of any level: a step
NODES, WEIGHTS = ((np.polynomial.legendre.leggauss(8)[0] + 1) / 2, np.polynomial.legendre.leggauss(8)[1] / 2)
TERMS = 16  # of the exponential's series inside a step
LEFT = (1 - NODES) ** np.arange(TERMS + 1)[:, None] * WEIGHTS  # of a step of 1: what is left of it to every power


@dataclass(frozen=True)
class Level:
    """y' = A y + W w(t); signals s = S y + T w(t) >= 0, each of the item that then turns.

    sizes: rows (s, y) and (s, w) of what round-off of s is measured against.
    tensions, limits, slips: rows of the sliders' forces, of their static limits, and of their own speeds.
    """

    matrix: np.ndarray
    inputs: np.ndarray
    signals: np.ndarray
    signal_inputs: np.ndarray
    sizes: tuple
    turns: list
    tensions: tuple
    limits: tuple
    slips: tuple
    steps: dict = field(default_factory=dict)

    @functools.cached_property
    def responses(self):
        """A^i W / i! of all inputs but the constant one, side by side (y, i w): of the exponential's series."""
        parts = [self.inputs[:, 1:]]
        for i in range(1, TERMS + 1):
            parts.append(self.matrix @ parts[-1] / i)
        return np.hstack(parts)

    def step(self, h):
        """exp(A h), and what the inputs at the nodes of a step add, (y, nodes w)."""
        key = float(f"{h:.11e}")
        if key not in self.steps:
            parts = [
                h * b * expm(self.matrix * (h * (1 - c))) @ self.inputs for b, c in zip(WEIGHTS, NODES, strict=True)
            ]
            self.steps[key] = expm(self.matrix * h), np.hstack(parts)
        return self.steps[key]


class Levels:
    """All levels of a system, on a grid of steps up to the last of ``times``, ``finer`` times as short as they may be.

    ways, speeds, accelerations: of the stops, as columns of the inputs w(t); nodes: of the grid.
    """

    def __init__(self, system, times, finer=1):
        self.step = STEP / finer
        self.system, self.end = system, times[-1]
        self.n, self.c = len(system.mass), len(system.stops)
        self.inverse = np.linalg.inv(system.mass)
        self.rows = np.array([s.row for s in system.stops]).reshape(self.c, self.n)
        self.rigid = [i for i, s in enumerate(system.stops) if np.isinf(s.stiffness)]
        self._built = {}
        self.functions = [lambda t: np.ones_like(t)]
        self.loads = [self._input(course.value) for _, course in system.loads]
        moving = [(s.course, s.course.rate, s.course.acceleration) if s.course else (None,) * 3 for s in system.stops]
        self.ways = [self._input(course and course.value) for course, _, _ in moving]
        self.speeds = [self._input(rate) for _, rate, _ in moving]
        self.accelerations = [self._input(acceleration) for _, _, acceleration in moving]
        passing = [(s.course.rate, s.course.acceleration) if s.course else (None, None) for s in system.sliders]
        self.slider_speeds = [self._input(rate) for rate, _ in passing]
        self.slider_accelerations = [self._input(acceleration) for _, acceleration in passing]
        self.size = 2 * self.n + self.c + 2 * len(system.sliders)
        self.sliding = Sliding(self)
        self.nodes = self._grid()
        self.at_nodes = self.inputs(self.nodes)
        widths = np.diff(self.nodes)
        self.at_quadrature = self.inputs((self.nodes[:-1, None] + widths[:, None] * NODES).ravel())
        self.at_quadrature = self.at_quadrature.reshape(len(widths), -1)

    def _input(self, function):
        if function is None:
            return None
        self.functions.append(function)
        return len(self.functions) - 1

    def inputs(self, t):
        return np.column_stack([function(t) for function in self.functions])

    def behind(self, t):
        """Inputs (w,) right after an instant, (k, w) after (k,) of them: what jumps at it has jumped."""
        found = self.inputs(np.minimum(np.atleast_1d(t) + TIMED * self.end, self.end))
        return found if np.ndim(t) else found[0]

    def _courses(self):
        moving = (*self.system.stops, *self.system.sliders)
        return [course for _, course in self.system.loads] + [s.course for s in moving if s.course]

    @functools.cached_property
    def input_rates(self):
        """(w, w): w' of w, as far as stops and counter-surfaces need it."""
        rates = np.zeros((len(self.functions), len(self.functions)))
        pairs = [*zip(self.ways, self.speeds, strict=True), *zip(self.speeds, self.accelerations, strict=True)]
        for of, rate in pairs:
            if of is not None and rate is not None:
                rates[of, rate] = 1.0
        return rates

    def _grid(self):
        end, courses = self.end, self._courses()
        longest = min([self.step / self.rate_of_all, end / 8, *(course.step for course in courses)])
        fine = [span for course in courses for span in course.fine]
        marks = {0.0, end, *(b for course in courses for b in course.breaks if 0 < b < end)}
        marks |= {float(np.clip(t, 0, end)) for span in fine for t in span[:2]}
        marks = sorted(marks)
        nodes = [0.0]
        for first, last in itertools.pairwise(marks):
            own = min([longest, *(step for a, b, step in fine if a < last and b > first)])
            nodes.extend(np.linspace(first, last, max(1, int(np.ceil((last - first) / own))) + 1)[1:])
        return np.array(nodes)

    @functools.cached_property
    def rate_of_all(self):
        """Rate [1/s] of the fastest motion of any level."""
        stiff, damped = self.system.stiffness.copy(), self.system.damping.copy()
        for stop in self.system.stops:
            if np.isfinite(stop.stiffness):
                stiff += stop.stiffness * np.outer(stop.row, stop.row)
                damped += stop.damping * np.outer(stop.row, stop.row)
        for slider in self.system.sliders:
            if np.isfinite(slider.stiffness):
                stiff += slider.stiffness * np.outer(slider.row, slider.row)
        for law in self.system.laws:
            stiff += np.max(np.abs(np.diff(law.forces) / np.diff(law.knots))) * np.outer(law.row, law.row)
        matrix = np.block([[np.zeros_like(stiff), np.eye(self.n)], [-self.inverse @ stiff, -self.inverse @ damped]])
        omega = np.sqrt(np.max(np.abs(np.linalg.eigvals(self.inverse @ stiff))))
        return max(omega, np.max(np.abs(np.linalg.eigvals(matrix))), 1 / self.end)

    def level(self, state):
        """Of contacts "open", "closed" or "inside", laws their segments, sliders "stick", "+", "-" or "off"."""
        if state not in self._built:
            self._built[state] = self._level(state)
        return self._built[state]

    def _level(self, state):
        """Everything is linear in (y, w): forces first, then accelerations, reactions and signals."""
        n, c, w, sliding = self.n, self.c, len(self.functions), self.sliding
        gap, rate, force = np.zeros((3, c, self.size))
        gap_w, rate_w, force_w = np.zeros((3, c, w))
        for i, stop in enumerate(self.system.stops):
            gap[i, :n], gap_w[i, 0], rate[i, n : 2 * n] = stop.row, stop.gap, stop.row
            if self.ways[i] is not None:
                gap_w[i, self.ways[i]] -= 1
            if self.speeds[i] is not None:
                rate_w[i, self.speeds[i]] -= 1
            if i not in self.rigid:
                force[i] = -stop.stiffness * gap[i] - stop.damping * rate[i]
                force_w[i] = -stop.stiffness * gap_w[i] - stop.damping * rate_w[i]
        closed = [i for i in range(c) if state[i] == "closed"]
        tension, tension_w = np.zeros((len(sliding.all), self.size)), np.zeros((len(sliding.all), w))
        slides, forces, tensions = dict(enumerate(state[sliding.first :])), (force, force_w), (tension, tension_w)
        stuck = [e for e, s in slides.items() if s == "stick" and sliding.rigid(e)]
        pulled = [e for e, s in slides.items() if s in SIGNS and sliding.all[e].contact in self.rigid]
        total, total_w = self.smooth_forces(state)
        for i in closed:
            if i not in self.rigid:
                total = total + np.outer(self.rows[i], force[i])
                total_w = total_w + np.outer(self.rows[i], force_w[i])
        for e in set(slides) - {*stuck, *pulled}:
            tension[e], tension_w[e] = sliding.known(e, slides[e], forces)
            total = total - np.outer(sliding.all[e].row, tension[e])
            total_w = total_w - np.outer(sliding.all[e].row, tension_w[e])
        held = [i for i in closed if i in self.rigid]
        if held or stuck:
            (total, total_w), reactions = self._reactions(held, stuck, {e: slides[e] for e in pulled}, total, total_w)
            for of, pull, found in zip(forces, tensions, reactions, strict=True):
                of[held], pull[stuck] = found[: len(held)], found[len(held) :]
        for e in pulled:
            tension[e], tension_w[e] = sliding.known(e, slides[e], forces)
        matrix, inputs = np.zeros((self.size, self.size)), np.zeros((self.size, w))
        matrix[:n, n : 2 * n] = np.eye(n)
        matrix[n : 2 * n], inputs[n : 2 * n] = self.inverse @ total, self.inverse @ total_w
        for i in closed:
            matrix[2 * n + i], inputs[2 * n + i] = force[i], force_w[i]
        limits, slips = sliding.fill(slides, matrix, inputs, forces, tensions)
        found = self._signals(state, (gap, gap_w), forces)
        found += sliding.signals(slides, tensions, limits, slips)
        signals = np.array([row for row, _, _ in found]).reshape(-1, self.size)
        signal_inputs = np.array([row for _, row, _ in found]).reshape(-1, w)
        turns = [turn for _, _, turn in found]
        sizes = sliding.sizes(state, (signals, signal_inputs), turns, limits, tensions)
        return Level(matrix, inputs, signals, signal_inputs, sizes, turns, tensions, limits, slips)

    def _reactions(self, held, stuck, pulled, total, total_w):
        """Forces with reactions, and the reactions, of contacts and of what sticks: each a pair of rows (y,) and (w,).

        pulled: states of the sliders whose limits are a share of the contacts' reactions. What they hold keeps no
        acceleration but round-off of itself.
        """
        sliders, wanted = self.system.sliders, np.zeros((len(held) + len(stuck), len(self.functions)))
        rows = np.array([self.rows[i] for i in held] + [sliders[e].row for e in stuck])
        pushes = np.array([self.rows[i] for i in held] + [-sliders[e].row for e in stuck]).T
        for e, s in pulled.items():
            pushes[:, held.index(sliders[e].contact)] -= SIGNS[s] * sliders[e].limit * sliders[e].row
        courses = [self.accelerations[i] for i in held] + [self.slider_accelerations[e] for e in stuck]
        for k, course in enumerate(courses):
            if course is not None:
                wanted[k, course] = 1
        flexibility = rows @ self.inverse @ pushes
        totals, reactions = [], []
        for given, asked in ((total, 0.0 * rows @ total), (total_w, wanted)):
            reaction, reached = np.zeros_like(asked), given
            for _ in range(2):
                more = np.linalg.solve(flexibility, asked - rows @ self.inverse @ reached)
                reaction, reached = reaction + more, reached + pushes @ more
            totals.append(reached)
            reactions.append(reaction)
        return totals, reactions

    def smooth_forces(self, state):
        """Of structure, loads and laws: rows (n, y) and (n, w)."""
        n, system = self.n, self.system
        total, total_w = np.zeros((n, self.size)), np.zeros((n, len(self.functions)))
        total[:, :n], total[:, n : 2 * n] = -system.stiffness, -system.damping
        total_w[:, 0] = system.constant
        for (row, _), k in zip(system.loads, self.loads, strict=True):
            total_w[:, k] += row
        for law, segment in zip(system.laws, state[self.c : self.sliding.first], strict=True):
            slope = np.diff(law.forces)[segment] / np.diff(law.knots)[segment]
            total[:, :n] -= slope * np.outer(law.row, law.row)
            total_w[:, 0] -= (law.forces[segment] - slope * law.knots[segment]) * law.row
        return total, total_w

    def _signals(self, state, gaps, forces):
        found = []
        for i, stop in enumerate(self.system.stops):
            gap, force = (gaps[0][i], gaps[1][i], i), (forces[0][i], forces[1][i], i)
            minus_gap = -gap[0], -gap[1], i
            if state[i] == "open":
                found.append(gap)
            elif state[i] == "inside":
                found += [minus_gap, (-forces[0][i], -forces[1][i], i)]
            else:
                found.append(force if i in self.rigid or stop.damping else minus_gap)
        for j, law in enumerate(self.system.laws):
            row, segment = np.zeros(self.size), state[self.c + j]
            row[: self.n], one = law.row, np.eye(1, len(self.functions))[0]
            if segment > 0:
                found.append((row, -law.knots[segment] * one, self.c + j))
            if segment < len(law.knots) - 2:
                found.append((-row, law.knots[segment + 1] * one, self.c + j))
        return found

    def lowest(self):
        return ("open",) * self.c + (0,) * len(self.system.laws) + ("off",) * len(self.system.sliders)

    def inside(self, level, y, t):
        """y(tau) after (y, t), within a step: (y,) of one tau, (y, k) of (k,)."""
        vectors = [y, level.matrix @ y + level.inputs[:, 0]]
        for i in range(2, TERMS + 1):
            vectors.append(level.matrix @ vectors[-1] / i)
        series, responses = np.array(vectors).T, level.responses

        def at(tau):
            taus = np.atleast_1d(tau)
            powers = np.vander(taus, TERMS + 2, increasing=True).T
            moved = series @ powers[:-1]
            if responses.size:
                times = taus[:, None] * NODES
                given = self.inputs((t + times).ravel())[:, 1:].reshape(*times.shape, -1)
                moments = np.einsum("iq,kqw->iwk", LEFT, given) * powers[1:, None]
                moved = moved + responses @ moments.reshape(-1, len(taus))
            return moved if np.ndim(tau) else moved[:, 0]

        return at
