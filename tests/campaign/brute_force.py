"""Brute force: a piecewise linear system under any loads, integrated level by level by matrix exponentials.

    M x'' + C x' + K x = sum_j p_j u_j(t) - M e z_b''(t) + sum_i h_i lambda_i,   g_i = h_i.x + gap_i - z_i(t)

    rigid      0 <= lambda, g >= 0, lambda g = 0, plastic impacts (Moreau)
    compliant  lambda = k max(0, -g)
    viscous    lambda = max(0, -k g - c g') where g < 0
    law        -F(q) along p, F straight between knots and beyond them

It shares no code with the package: matrices, rows and functions of time come in, motion goes out. The state
y = (x, x', J), J the impulses of the contacts, is carried exactly over equal steps (loads by Gauss-Legendre
quadrature); signs are looked at after every step, dips between steps wherever three values in a row suggest one, and
roots are found by bisection's faster kin. Impacts and what closes after them are decided by trying every set of
contacts: the one whose motion stays admissible a moment later is right.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

STEP = 0.35  # times the fastest rate of any level: a step
NODES, WEIGHTS = ((np.polynomial.legendre.leggauss(8)[0] + 1) / 2, np.polynomial.legendre.leggauss(8)[1] / 2)
TERMS = 16  # of the exponential's series inside a step
ZERO = 1e-12  # of the lengths and speeds of the scene: what is at a stop
TOUCH = 1e-11  # of the same: a signal has fallen below zero, above what constraints drift by in a run
SOON = 1e-7  # of a step: after which a signal that an instant has left at zero has a sign
MOMENT = 1e-3  # of a step: after which a set of closed contacts is looked at
LEAST, BLOCK = 8, 64  # steps between two looks at the signs
MOST_EVENTS = 600  # more are given up
MOST_ROCKING, SLOW = (
    6,
    1e-7,
)  # instants close together, of speeds below a share of the scene's: an end of endless impacts
FINE = 17  # places in two steps at which a dip is looked for
ROUND_OFF = 1e-15  # of the terms of a gap: it is zero
DEPENDENT = 1e-10  # of the largest: an eigenvalue of the contacts' flexibility that is none


class NoAnswer(Exception):
    """The integrator gives up: too many events, or no admissible set of contacts."""


@dataclass(frozen=True)
class Course:
    """u(t), u'(t), u''(t) of (k,) times; fine: (t0, t1, step) of shorter steps; breaks: where u is not smooth."""

    value: Callable
    rate: Callable | None = None
    acceleration: Callable | None = None
    breaks: tuple = ()
    fine: tuple = ()
    step: float = np.inf


@dataclass(frozen=True)
class Stop:
    """A contact: row h, gap [m], stiffness k and damping c; course of its stop."""

    row: np.ndarray
    gap: float
    stiffness: float = np.inf
    damping: float = 0.0
    course: Course | None = None


@dataclass(frozen=True)
class Law:
    """A force law along a row: F through (knots, forces)."""

    row: np.ndarray
    knots: np.ndarray
    forces: np.ndarray


@dataclass(frozen=True)
class System:
    """M, C, K (n, n), contacts, laws, loads [(row, course)]; base: (e, course), which fixed stops hear as well."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    stops: Sequence[Stop] = ()
    laws: Sequence[Law] = ()
    loads: Sequence[tuple[np.ndarray, Course]] = ()
    constant: np.ndarray | float = 0.0


@dataclass
class Answer:
    """x, x' (n, k) at the times asked for, events [(time, contact, state)], impulses (c,), energy lost by impacts.

    length, speed: of the scene, what its gaps, start, stops and loads make [m, m/s].
    """

    displacement: np.ndarray
    velocity: np.ndarray
    events: list = field(default_factory=list)
    impulse: np.ndarray | None = None
    impact: float = 0.0
    length: float = 0.0
    speed: float = 0.0


def solved(system, displacement, velocity, times, touch=TOUCH):
    """Motion from t = 0 at times (k,), ascending; touch: of the scene's lengths, see TOUCH."""
    return _Integration(system, np.asarray(times, float), touch).run(displacement, velocity)


@dataclass(frozen=True)
class _Level:
    """y' = A y + W w(t); signals s = S y + T w(t) >= 0, each of (item, what it turns to)."""

    matrix: np.ndarray
    inputs: np.ndarray
    signals: np.ndarray
    signal_inputs: np.ndarray
    turns: list
    steps: dict = field(default_factory=dict)

    def step(self, h):
        """exp(A h), and what the inputs at the nodes of a step add, (y, nodes w)."""
        key = float(f"{h:.11e}")
        if key not in self.steps:
            parts = [
                h * b * expm(self.matrix * (h * (1 - c))) @ self.inputs for b, c in zip(WEIGHTS, NODES, strict=True)
            ]
            self.steps[key] = expm(self.matrix * h), np.hstack(parts)
        return self.steps[key]


class _Integration:
    def __init__(self, system, times, touch):
        self.system, self.times, self.touch = system, times, touch
        self.n, self.c = len(system.mass), len(system.stops)
        self.inverse = np.linalg.inv(system.mass)
        self.rows = np.array([s.row for s in system.stops]).reshape(self.c, self.n)
        self.rigid = [i for i, s in enumerate(system.stops) if np.isinf(s.stiffness)]
        self.levels = {}
        self.functions = [lambda t: np.ones_like(t)]
        self.loads = [self._input(course.value) for _, course in system.loads]
        moving = [(s.course, s.course.rate, s.course.acceleration) if s.course else (None,) * 3 for s in system.stops]
        self.ways = [self._input(course and course.value) for course, _, _ in moving]
        self.speeds = [self._input(rate) for _, rate, _ in moving]
        self.accelerations = [self._input(acceleration) for _, _, acceleration in moving]
        self.nodes = self._grid()
        self.at_nodes = self._inputs(self.nodes)
        widths = np.diff(self.nodes)
        self.inside = self._inputs((self.nodes[:-1, None] + widths[:, None] * NODES).ravel())
        self.inside = self.inside.reshape(len(widths), -1)

    def _input(self, function):
        if function is None:
            return None
        self.functions.append(function)
        return len(self.functions) - 1

    def _inputs(self, t):
        return np.column_stack([function(t) for function in self.functions])

    def _courses(self):
        return [course for _, course in self.system.loads] + [s.course for s in self.system.stops if s.course]

    def _grid(self):
        end, courses = self.times[-1], self._courses()
        longest = min([STEP / self._fastest(), end / 8, *(course.step for course in courses)])
        fine = [span for course in courses for span in course.fine]
        marks = {0.0, end, *(b for course in courses for b in course.breaks if 0 < b < end)}
        marks |= {float(np.clip(t, 0, end)) for span in fine for t in span[:2]}
        marks = sorted(marks)
        nodes = [0.0]
        for first, last in itertools.pairwise(marks):
            own = min([longest, *(step for a, b, step in fine if a < last and b > first)])
            nodes.extend(np.linspace(first, last, max(1, int(np.ceil((last - first) / own))) + 1)[1:])
        return np.array(nodes)

    def _fastest(self):
        """Rate [1/s] of the fastest motion of any level."""
        stiff, damped = self.system.stiffness.copy(), self.system.damping.copy()
        for stop in self.system.stops:
            if np.isfinite(stop.stiffness):
                stiff += stop.stiffness * np.outer(stop.row, stop.row)
                damped += stop.damping * np.outer(stop.row, stop.row)
        for law in self.system.laws:
            stiff += np.max(np.abs(np.diff(law.forces) / np.diff(law.knots))) * np.outer(law.row, law.row)
        matrix = np.block([[np.zeros_like(stiff), np.eye(self.n)], [-self.inverse @ stiff, -self.inverse @ damped]])
        omega = np.sqrt(np.max(np.abs(np.linalg.eigvals(self.inverse @ stiff))))
        return max(omega, np.max(np.abs(np.linalg.eigvals(matrix))), 1 / self.times[-1])

    # ------------------------------------------------------------------ levels

    def level(self, state):
        """The linear system of a state: of every contact "open", "closed" or "inside", of every law its segment."""
        if state not in self.levels:
            self.levels[state] = self._level(state)
        return self.levels[state]

    def _level(self, state):
        """Everything is linear in (y, w): forces first, then accelerations, reactions and signals."""
        n, c, w = self.n, self.c, len(self.functions)
        gap, rate, force = np.zeros((3, c, 2 * n + c)), None, None
        gap, rate, force = gap
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
        total, total_w = self._smooth_forces(state)
        closed = [i for i in range(c) if state[i] == "closed"]
        for i in closed:
            if i not in self.rigid:
                total = total + np.outer(self.rows[i], force[i])
                total_w = total_w + np.outer(self.rows[i], force_w[i])
        held = [i for i in closed if i in self.rigid]
        if held:
            rows = self.rows[held]
            wanted = np.zeros((len(held), w))
            for k, i in enumerate(held):
                if self.accelerations[i] is not None:
                    wanted[k, self.accelerations[i]] = 1
            flexibility = rows @ self.inverse @ rows.T
            force[held] = np.linalg.solve(flexibility, -rows @ self.inverse @ total)
            force_w[held] = np.linalg.solve(flexibility, wanted - rows @ self.inverse @ total_w)
            total, total_w = total + rows.T @ force[held], total_w + rows.T @ force_w[held]
        matrix, inputs = np.zeros((2 * n + c, 2 * n + c)), np.zeros((2 * n + c, w))
        matrix[:n, n : 2 * n] = np.eye(n)
        matrix[n : 2 * n], inputs[n : 2 * n] = self.inverse @ total, self.inverse @ total_w
        for i in closed:
            matrix[2 * n + i], inputs[2 * n + i] = force[i], force_w[i]
        return _Level(matrix, inputs, *self._signals(state, (gap, gap_w), (force, force_w)))

    def _smooth_forces(self, state):
        """Of structure, loads and laws: rows (n, y) and (n, w)."""
        n, system = self.n, self.system
        total, total_w = np.zeros((n, 2 * n + self.c)), np.zeros((n, len(self.functions)))
        total[:, :n], total[:, n : 2 * n] = -system.stiffness, -system.damping
        total_w[:, 0] = system.constant
        for (row, _), k in zip(system.loads, self.loads, strict=True):
            total_w[:, k] += row
        for law, segment in zip(system.laws, state[self.c :], strict=True):
            slope = np.diff(law.forces)[segment] / np.diff(law.knots)[segment]
            total[:, :n] -= slope * np.outer(law.row, law.row)
            total_w[:, 0] -= (law.forces[segment] - slope * law.knots[segment]) * law.row
        return total, total_w

    def _signals(self, state, gaps, forces):
        found, turns = [], []
        for i, stop in enumerate(self.system.stops):
            gap, force = (gaps[0][i], gaps[1][i]), (forces[0][i], forces[1][i])
            minus_gap, minus_force = (-gap[0], -gap[1]), (-force[0], -force[1])
            if state[i] == "open":
                found.append(gap)
            elif state[i] == "inside":
                found += [minus_gap, minus_force]
                turns.append(i)
            else:
                found.append(force if i in self.rigid or stop.damping else minus_gap)
            turns.append(i)
        for j, law in enumerate(self.system.laws):
            row, segment = np.zeros(2 * self.n + self.c), state[self.c + j]
            row[: self.n], one = law.row, np.eye(1, len(self.functions))[0]
            if segment > 0:
                found.append((row, -law.knots[segment] * one))
                turns.append(self.c + j)
            if segment < len(law.knots) - 2:
                found.append((-row, law.knots[segment + 1] * one))
                turns.append(self.c + j)
        if not found:
            return np.zeros((0, 2 * self.n + self.c)), np.zeros((0, len(self.functions))), []
        return np.array([row for row, _ in found]), np.array([row for _, row in found]), turns

    # ------------------------------------------------------------------ motion

    def run(self, displacement, velocity):
        """From the start to the last time."""
        self.length = max([np.max(np.abs(displacement)), *(abs(s.gap) for s in self.system.stops)])
        self.length = max([self.length, np.max(np.abs(velocity)) * 4 * STEP / self._fastest()])
        self.length = max([self.length, *(np.max(np.abs(law.knots)) for law in self.system.laws)])
        ways = [np.max(np.abs(self.at_nodes[:, k])) for k in self.ways if k is not None]
        self.length = max([self.length, *ways])
        accelerations = np.abs(self.at_nodes) @ np.max(np.abs(self._smooth_forces(self._lowest())[1]), axis=0)
        self.length = max(self.length, np.max(accelerations) * (STEP / self._fastest()) ** 2, 1e-300)
        self.speed = self.length * self._fastest()
        y, t, k = np.concatenate([displacement, velocity, np.zeros(self.c)]), 0.0, 0
        answer = Answer(*np.zeros((2, self.n, len(self.times))), length=self.length, speed=self.speed)
        state, y = self._settled(self._lowest(), y, 0.0, answer)
        shown, instants, block, rocking, before = 0, 0, LEAST, 0, 0.0
        while k < len(self.nodes) - 1:
            level = self.level(state)
            found = self._piece(level, y, t, k, block)
            block = LEAST if found.event else min(2 * block, BLOCK)
            shown = self._show(answer, level, found, shown)
            y, t, k = found.y, found.t, found.k
            if found.event:
                instants += 1
                if instants > MOST_EVENTS:
                    raise NoAnswer("too many events")
                rocking = rocking + 1 if t - before <= 100 * self._moment(t) else 0
                before = t
                if rocking > MOST_ROCKING:
                    y = self._at_rest(y, t)
                state, y = self._settled(state, y, t, answer)
        if shown < len(self.times):
            answer.displacement[:, shown:], answer.velocity[:, shown:] = y[: self.n, None], y[self.n : 2 * self.n, None]
        answer.impulse = y[2 * self.n :]
        return answer

    def _lowest(self):
        return ("open",) * self.c + (0,) * len(self.system.laws)

    def _piece(self, level, y, t, k, block):
        """Up to ``block`` steps from (y, t) in the interval k, no further than a first event."""
        nodes, states, k0 = self.nodes, [y], k
        first = self.nodes[k + 1] - t
        if t > nodes[k]:
            states.append(self._inside(level, y, t)(first))
            k += 1
        last = min(len(nodes) - 1, k + block)
        while k < last:
            e, g = level.step(nodes[k + 1] - nodes[k])
            states.append(e @ states[-1] + g @ self.inside[k])
            k += 1
        times = np.concatenate([[t], nodes[k0 + 1 : k + 1]])
        states = np.array(states)
        event = self._first_event(level, times, states)
        if event is None:
            return _Piece(times, states, states[-1], times[-1], k, False)
        j, tau = event
        y_event = self._inside(level, states[j], times[j])(tau)
        t_event = times[j] + tau
        k_event = k0 + j
        if t_event >= nodes[k_event + 1]:
            t_event, k_event = nodes[k_event + 1], k_event + 1
        return _Piece(times[: j + 1], states[: j + 1], y_event, t_event, k_event, True)

    def _inside(self, level, y, t):
        """y(tau) after (y, t), within a step: (y,) of one tau, (y, k) of (k,)."""
        vectors = [y, level.matrix @ y + level.inputs[:, 0]]
        for i in range(2, TERMS + 1):
            vectors.append(level.matrix @ vectors[-1] / i)
        series, powers, varying = np.array(vectors).T, np.arange(TERMS + 1), level.inputs[:, 1:]

        def at(tau):
            taus = np.atleast_1d(tau)
            moved = series @ taus ** powers[:, None]
            if varying.size:
                times = taus[:, None] * NODES
                part = varying @ (self._inputs((t + times).ravel())[:, 1:] * (taus[:, None] * WEIGHTS).reshape(-1, 1)).T
                left = (taus[:, None] - times).ravel()
                total = part.copy()
                for i in range(1, TERMS + 1):
                    part = level.matrix @ part * (left / i)
                    total += part
                moved = moved + total.reshape(len(y), len(taus), len(NODES)).sum(axis=2)
            return moved if np.ndim(tau) else moved[:, 0]

        return at

    def _first_event(self, level, times, states):
        """(step, time inside it) of the first signal that falls below zero."""
        if not len(level.signals) or len(times) < 2:
            return None
        inputs = self._inputs(times)
        s = states @ level.signals.T + inputs @ level.signal_inputs.T
        allowed = ZERO * (np.abs(states) @ np.abs(level.signals).T + np.abs(inputs) @ np.abs(level.signal_inputs).T)
        largest = np.repeat([self.length, self.speed, 0.0], [self.n, self.n, self.c])
        allowed = np.maximum.accumulate(allowed + self.touch * (np.abs(level.signals) @ largest), axis=0)
        below = s[1:] < -allowed[1:]
        curved = np.zeros_like(below)
        if len(s) > 2:
            low = (s[1:-1] <= s[:-2]) & (s[1:-1] <= s[2:]) & (s[1:-1] < 2 * (s[:-2] - 2 * s[1:-1] + s[2:]))
            curved[:-1] |= low
            curved[1:] |= low
        curved[0] |= s[0] < 4 * np.abs(s[1] - s[0])
        curved[-1] |= s[-1] < 4 * np.abs(s[-1] - s[-2])
        for j in np.flatnonzero(np.any(below | curved, axis=1)):
            roots = [
                self._root(level, i, times, states, j, allowed[j + 1, i]) for i in np.flatnonzero(below[j] | curved[j])
            ]
            roots = [root for root in roots if root is not None]
            if roots:
                return j, min(roots)
        return None

    def _root(self, level, i, times, states, j, allowed):
        width, at = times[j + 1] - times[j], self._inside(level, states[j], times[j])

        def s(tau):
            taus = np.atleast_1d(tau)
            values = level.signals[i] @ at(taus) + self._inputs(times[j] + taus) @ level.signal_inputs[i]
            return values if np.ndim(tau) else float(values[0])

        moment = SOON * min(width, STEP / self._rate_of_all)
        at_zero = j == 0 and abs(s(0.0)) <= 5 * allowed  # where an instant has left it: a moment later it has a sign
        first = min(moment, width) if at_zero else 0.0
        places = first + (width - first) * (np.linspace(0, 1, FINE) ** 2)
        values = s(places)
        below = np.flatnonzero(values < -allowed)
        if not len(below):
            return None
        if below[0] == 0:
            return first
        above = int(np.flatnonzero(values[: below[0]] > 0)[-1]) if np.any(values[: below[0]] > 0) else -1
        if above < below[0] - 1:  # round-off of zero before it falls
            return places[max(above + 1, 0)]
        ends = places[above], places[above + 1]
        if s(ends[0]) <= 0:  # round-off of zero, by another order of sums
            return ends[0]
        return brentq(s, *ends, xtol=1e-15 * times[-1], rtol=1e-14)

    def _show(self, answer, level, piece, shown):
        """Fills in the times asked for that lie in the piece."""
        last = np.searchsorted(self.times, piece.t, side="left" if piece.event else "right")
        for i in range(shown, last):
            j = max(0, int(np.searchsorted(piece.times, self.times[i], side="right")) - 1)
            y = piece.states[j]
            if self.times[i] > piece.times[j]:
                y = self._inside(level, y, piece.times[j])(self.times[i] - piece.times[j])
            answer.displacement[:, i], answer.velocity[:, i] = y[: self.n], y[self.n : 2 * self.n]
        return max(shown, int(last))

    # ------------------------------------------------------------------ what follows an instant

    def _settled(self, before, y, t, answer):
        """The state after an instant, and y behind its impacts."""
        w = self._inputs(np.array([t]))[0]
        touching = self._touching(y, w)
        y = self._without_drift(y, w, touching)
        y = self._struck(y, w, touching, answer)
        resting = [i for i in touching if abs(self._rate(i, y, w)) <= ZERO * self.speed * 10]
        best, worst = None, np.inf
        for count in range(len(resting) + 1):
            for held in itertools.combinations(resting, count):
                if worst <= ZERO or not self._independent(held):
                    continue
                state = self._compliant(before, held, y, t)
                violation = self._violation(state, resting, y, t)
                if violation < worst:
                    best, worst = state, violation
        if best is None or worst > 1e-3:
            raise NoAnswer(f"no admissible set at t = {t:g}")
        for i, (old, new) in enumerate(zip(before, best, strict=True)):
            if old != new:
                answer.events.append((t, i, new))
        return best, y

    def _at_rest(self, y, t):
        """y behind ever faster impacts of several contacts in turn, which end at rest at all of them."""
        w = self._inputs(np.array([t]))[0]
        slow = [i for i in self._touching(y, w) if abs(self._rate(i, y, w)) <= SLOW * self.speed]
        if not slow:
            return y
        rows, u = self.rows[slow], np.array([self._rate(i, y, w) for i in slow])
        impulses = -np.linalg.pinv(rows @ self.inverse @ rows.T, rcond=DEPENDENT) @ u
        y = y.copy()
        y[self.n : 2 * self.n] += self.inverse @ rows.T @ impulses
        return y

    def _without_drift(self, y, w, touching):
        """y with round-off of the gaps of what touches taken away, which a long contact has added up."""
        if not touching:
            return y
        rows = self.rows[touching]
        gaps = [rows[k] @ y[: self.n] + self._offset(i, w) for k, i in enumerate(touching)]
        pulled = np.linalg.pinv(rows @ self.inverse @ rows.T, rcond=DEPENDENT) @ np.array(gaps)
        y = y.copy()
        y[: self.n] -= self.inverse @ rows.T @ pulled
        return y

    def _offset(self, i, w):
        """gap_i - z_i [m]."""
        return self.system.stops[i].gap - (0.0 if self.ways[i] is None else w[self.ways[i]])

    def _touching(self, y, w):
        gaps = self.rows @ y[: self.n] + [s.gap for s in self.system.stops]
        gaps -= [0.0 if k is None else w[k] for k in self.ways]
        near = [i for i in self.rigid if gaps[i] <= 10 * self.touch * self.length * np.sum(np.abs(self.rows[i]))]
        if any(gaps[i] < -1e-6 * self.length for i in near):
            raise NoAnswer("inside a rigid stop")
        return near

    def _rate(self, i, y, w):
        return self.rows[i] @ y[self.n : 2 * self.n] - (0.0 if self.speeds[i] is None else w[self.speeds[i]])

    def _independent(self, held):
        if not held:
            return True
        values = np.linalg.eigvalsh(self.rows[list(held)] @ self.inverse @ self.rows[list(held)].T)
        return values[0] > DEPENDENT * values[-1]

    def _struck(self, y, w, touching, answer):
        """Moreau's impact: impulses p >= 0, speeds u >= 0, p u = 0, by trying every set."""
        u = np.array([self._rate(i, y, w) for i in touching])
        if not len(u) or np.min(u) >= -ZERO * self.speed:
            return y
        rows = self.rows[touching]
        flexibility, best = rows @ self.inverse @ rows.T, (np.inf, None)
        for count in range(1, len(touching) + 1):
            for chosen in itertools.combinations(range(len(touching)), count):
                pushed = list(chosen)
                if not self._independent([touching[i] for i in pushed]):
                    continue
                impulses = np.zeros(len(touching))
                impulses[pushed] = np.linalg.solve(flexibility[np.ix_(pushed, pushed)], -u[pushed])
                after = u + flexibility @ impulses
                violation = max(np.max(-impulses) * np.max(np.diag(flexibility)), np.max(-after)) / self.speed
                if violation < 0.1 * best[0]:
                    best = max(violation, ZERO / 10), impulses
        if best[0] > 1e-8:
            raise NoAnswer("no admissible impact")
        y = y.copy()
        answer.impact += float(-best[1] @ u - 0.5 * best[1] @ flexibility @ best[1])
        y[self.n : 2 * self.n] += self.inverse @ rows.T @ best[1]
        y[2 * self.n :][touching] += best[1]
        return y

    def _moment(self, t):
        """A short time [s]: of the fastest motion, less where loads change within a step."""
        k = min(int(np.searchsorted(self.nodes, t, side="right")), len(self.nodes) - 1)
        return (
            MOMENT * STEP / self._rate_of_all * float(np.clip(100 * (self.nodes[k] - t) * self._rate_of_all, 0.02, 1))
        )

    @property
    def _rate_of_all(self):
        if not hasattr(self, "_known"):
            self._known = self._fastest()
        return self._known

    def _compliant(self, before, held, y, t):
        """The state with these rigid contacts closed: the others by where they are, or will be a moment later."""
        state = list(before)
        for i in self.rigid:
            state[i] = "closed" if i in held else "open"
        for _ in range(6):
            level, tau = self.level(tuple(state)), self._moment(t)
            later, known = self._inside(level, y, t)(tau), tuple(state)
            now, then = self._inputs(np.array([t, t + tau]))
            for i, stop in enumerate(self.system.stops):
                if i not in self.rigid:
                    state[i] = self._by_place(i, stop, (y, now), (later, then))
            for j, law in enumerate(self.system.laws):
                q = law.row @ y[: self.n]
                if np.min(np.abs(law.knots - q)) <= ZERO * self.length:
                    q = law.row @ later[: self.n]
                state[self.c + j] = int(np.clip(np.searchsorted(law.knots, q) - 1, 0, len(law.knots) - 2))
            if tuple(state) == known:
                break
        return tuple(state)

    def _by_place(self, i, stop, now, later):
        def gap(at):
            return self.rows[i] @ at[0][: self.n] + stop.gap - (0.0 if self.ways[i] is None else at[1][self.ways[i]])

        g = gap(now)
        place = now if abs(g) > ZERO * self.length else later
        g = gap(place)
        if g > 0 or not stop.damping:
            return "open" if g > 0 else "closed"
        force = -stop.stiffness * g - stop.damping * self._rate(i, *place)
        if abs(force) <= ZERO * (stop.stiffness * self.length + stop.damping * self.speed):
            force = -stop.stiffness * gap(later) - stop.damping * self._rate(i, *later)
        return "closed" if force > 0 else "inside"

    def _violation(self, state, resting, y, t):
        """By how much the motion of a state leaves what is admissible a moment later, of what it could."""
        if not resting:
            return 0.0
        level, tau = self.level(state), self._moment(t)
        at = self._inside(level, y, t)
        worst = 0.0
        for share in (0.5, 1.0):
            later = at(share * tau)
            w = self._inputs(np.array([t + share * tau]))[0]
            s = level.signals @ later + level.signal_inputs @ w
            for value, i, row, row_w in zip(s, level.turns, level.signals, level.signal_inputs, strict=True):
                if i in resting:
                    size = np.abs(row) @ np.abs(later) + np.abs(row_w) @ np.abs(w)
                    if state[i] == "open":
                        value = value if abs(value) > ROUND_OFF * size else 0.0
                        size = self.length * (self._rate_of_all * share * tau) ** 2
                    worst = max(worst, -value / size if size else 0.0)
        return worst


@dataclass(frozen=True)
class _Piece:
    times: np.ndarray
    states: np.ndarray
    y: np.ndarray
    t: float
    k: int
    event: bool
