"""Integration for brute force: from event to event over equal steps, signs looked at after every step."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from brute_force.instants import ZERO, Instants
from brute_force.levels import STEP, Levels
from brute_force.sliding import TIMED
from brute_force.system import Answer, NoAnswer

TOUCH = (
    1e-11  # of the scene's lengths and speeds: a signal has fallen below zero, above what constraints drift by in a run
)
SOON = 1e-8  # of a step: after which a signal that an instant has left at zero has a sign
LEAST, BLOCK = 8, 64  # steps between two looks at the signs
MOST_EVENTS = 2000  # more are given up
MOST_ROCKING = 6  # instants close together: an end of endless impacts
MOST_AGAIN = 2  # of the same, from which on what was decided by round-off is decided by less
SLOW = 1e-7  # of the scene's speeds: what they end with
FINE = 17  # places in two steps at which a dip is looked for
GROWTH = 4.0  # from a place to the next one behind an instant


def solved(system, displacement, velocity, times, touch=TOUCH, finer=1, rocking=MOST_ROCKING, slow=SLOW):
    """Motion from t = 0 at times (k,), ascending; touch: of the scene's lengths, see TOUCH.

    finer: steps, and with them the looks at signs, are so many times as short: a shorter dip is seen.
    rocking: instants close together after which endless impacts are ended. slow: of the scene's speeds, with which.
    """
    return _Integration(system, np.asarray(times, float), touch, finer, rocking, slow).run(displacement, velocity)


class _Integration:
    def __init__(self, system, times, touch, finer, rocking, slow):
        self.times, self.touch, self.rocking, self.slow = times, touch, rocking, slow
        self.levels = Levels(system, times, finer)
        self.n = self.levels.n

    def run(self, displacement, velocity):
        """From the start to the last time."""
        self.length = max([np.max(np.abs(displacement)), *(abs(s.gap) for s in self.levels.system.stops)])
        self.length = max([self.length, np.max(np.abs(velocity)) * 4 * STEP / self.levels.rate_of_all])
        self.length = max([self.length, *(np.max(np.abs(law.knots)) for law in self.levels.system.laws)])
        ways = [np.max(np.abs(self.levels.at_nodes[:, k])) for k in self.levels.ways if k is not None]
        self.length = max([self.length, *ways])
        passing = [np.max(np.abs(self.levels.at_nodes[:, k])) for k in self.levels.slider_speeds if k is not None]
        passing += [abs(slider.velocity) for slider in self.levels.system.sliders]
        self.length = max([self.length, *(4 * STEP / self.levels.rate_of_all * v for v in passing)])
        accelerations = np.abs(self.levels.at_nodes) @ np.max(
            np.abs(self.levels.smooth_forces(self.levels.lowest())[1]), axis=0
        )
        self.length = max(self.length, np.max(accelerations) * (STEP / self.levels.rate_of_all) ** 2, 1e-300)
        self.speed = self.length * self.levels.rate_of_all
        y, t, k = np.concatenate([displacement, velocity, np.zeros(self.levels.size - 2 * self.n)]), 0.0, 0
        instants = Instants(self.levels, self.length, self.speed, self.touch)
        length = max(self.length, self.levels.sliding.largest_stretch())
        size = {"length": length, "speed": length * self.levels.rate_of_all}
        answer = Answer(*np.zeros((2, self.n, len(self.times))), **size)
        state, y = instants.settled(self.levels.lowest(), y, 0.0, answer)
        shown, count, block, rocking, before = 0, 0, LEAST, 0, 0.0
        while k < len(self.levels.nodes) - 1:
            level = self.levels.level(state)
            found = self._piece(level, y, t, k, block)
            block = LEAST if found.event else min(2 * block, BLOCK)
            shown = self._show(answer, level, found, shown)
            y, t, k = found.y, found.t, found.k
            if found.event:
                count += 1
                if count > MOST_EVENTS:
                    raise NoAnswer("too many events")
                rocking = rocking + 1 if t - before <= 100 * instants.moment(t) else 0
                before = t
                if rocking > self.rocking:
                    y = instants.at_rest(state, y, t, self.slow)
                state, y = instants.settled(state, y, t, answer, again=rocking > MOST_AGAIN)
        if shown < len(self.times):
            answer.displacement[:, shown:], answer.velocity[:, shown:] = (
                y[: self.n, None],
                y[self.n : 2 * self.n, None],
            )
        answer.impulse = y[2 * self.n : 2 * self.n + self.levels.c]
        answer.slipped = y[self.levels.sliding.way :]
        answer.rubbed += sum(
            s.limit * way
            for s, way in zip(self.levels.system.sliders, answer.slipped, strict=True)
            if s.contact is None
        )
        return answer

    def _piece(self, level, y, t, k, block):
        """Up to ``block`` steps from (y, t) in the interval k, no further than a first event."""
        nodes, states, k0 = self.levels.nodes, [y], k
        first = self.levels.nodes[k + 1] - t
        if t > nodes[k]:
            states.append(self.levels.inside(level, y, t)(first))
            k += 1
        last = min(len(nodes) - 1, k + block)
        while k < last:
            e, g = level.step(nodes[k + 1] - nodes[k])
            states.append(e @ states[-1] + g @ self.levels.at_quadrature[k])
            k += 1
        times = np.concatenate([[t], nodes[k0 + 1 : k + 1]])
        states = np.array(states)
        event = self._first_event(level, times, states)
        if event is None:
            return _Piece(times, states, states[-1], times[-1], k, False)
        j, tau = event
        y_event = self.levels.inside(level, states[j], times[j])(tau)
        t_event = times[j] + tau
        k_event = k0 + j
        if t_event >= nodes[k_event + 1] - 2 * TIMED * nodes[-1]:  # what jumps there has jumped
            t_event, k_event = nodes[k_event + 1], k_event + 1
        return _Piece(times[: j + 1], states[: j + 1], y_event, t_event, k_event, True)

    def _first_event(self, level, times, states):
        """(step, time inside it) of the first signal that falls below zero."""
        if not len(level.signals) or len(times) < 2:
            return None
        inputs = self.levels.behind(times)
        s = states @ level.signals.T + inputs @ level.signal_inputs.T
        allowed = ZERO * (np.abs(states) @ level.sizes[0].T + np.abs(inputs) @ level.sizes[1].T)
        largest = np.concatenate(
            [
                np.repeat([self.length, self.speed, 0.0], [self.n, self.n, self.levels.c]),
                self.levels.sliding.largest_tensions(self.length),
                np.zeros(len(self.levels.system.sliders)),
            ]
        )
        allowed = np.maximum.accumulate(allowed + self.touch * (np.abs(level.signals) @ largest), axis=0)
        below = s[1:] < -allowed[1:]
        curved, bends = np.zeros_like(below), np.zeros((1, s.shape[1]))
        if len(s) > 2:
            bends = s[:-2] - 2 * s[1:-1] + s[2:]
            low = (s[1:-1] <= s[:-2]) & (s[1:-1] <= s[2:]) & (s[1:-1] < 2 * bends)
            curved[:-1] |= low
            curved[1:] |= low
        rate = (states @ level.matrix.T + inputs @ level.inputs.T) @ level.signals.T
        curved |= (rate[:-1] < 0) & (rate[1:] > 0)  # it turns inside the step
        curved[0] |= s[0] < 4 * np.abs(s[1] - s[0]) + 2 * np.abs(bends[0])
        curved[-1] |= s[-1] < 4 * np.abs(s[-1] - s[-2]) + 2 * np.abs(bends[-1])
        for j in np.flatnonzero(np.any(below | curved, axis=1)):
            inside = self._inside(level, times[j], states[j])
            roots = [
                self._root(level, i, times, j, allowed[j + 1, i], inside) for i in np.flatnonzero(below[j] | curved[j])
            ]
            roots = [root for root in roots if root is not None]
            if roots:
                return j, min(roots)
        return None

    def _inside(self, level, t, y):
        """States and inputs at instants inside a step from (y, t): what one signal has asked for is kept for others."""
        at, kept = self.levels.inside(level, y, t), {}

        def inside(taus):
            key = taus.tobytes()
            if key not in kept:
                kept[key] = at(taus), self.levels.behind(t + taus)
            return kept[key]

        return inside

    def _root(self, level, i, times, j, allowed, inside):
        width = times[j + 1] - times[j]

        def s(tau):
            states, inputs = inside(np.atleast_1d(tau))
            values = level.signals[i] @ states + inputs @ level.signal_inputs[i]
            return values if np.ndim(tau) else float(values[0])

        moment = SOON * min(width, STEP / self.levels.rate_of_all)
        at_zero = j == 0 and abs(s(0.0)) <= 5 * allowed  # where an instant has left it: a moment later it has a sign
        first = min(moment, width) if at_zero else 0.0
        places = first + (width - first) * (np.linspace(0, 1, FINE) ** 2)
        if 0 < first < width:  # what leaves its zero may be back long before the second of these
            places = np.union1d(places, first * GROWTH ** np.arange(np.log(width / first) / np.log(GROWTH)))
        values = s(places)
        lowest = int(np.argmin(values))
        around = np.linspace(places[max(lowest - 1, 0)], places[min(lowest + 1, len(places) - 1)], FINE)
        places = np.union1d(places, around)
        values = s(places)
        below = np.flatnonzero(values < -allowed)
        if not len(below):
            return None
        if below[0] == 0:
            return first
        positive = np.flatnonzero(values[: below[0]] > 0)
        if not len(positive):  # round-off of zero before it falls
            return places[0]
        ends = places[positive[-1]], places[positive[-1] + 1]
        for end, sign in zip(ends, (1, -1), strict=True):
            if sign * s(end) <= 0:  # round-off of zero, by another order of sums
                return end
        return brentq(s, *ends, xtol=1e-15 * times[-1], rtol=1e-14)

    def _show(self, answer, level, piece, shown):
        """Fills in the times asked for that lie in the piece."""
        last = np.searchsorted(self.times, piece.t, side="left" if piece.event else "right")
        for i in range(shown, last):
            j = max(0, int(np.searchsorted(piece.times, self.times[i], side="right")) - 1)
            y = piece.states[j]
            if self.times[i] > piece.times[j]:
                y = self.levels.inside(level, y, piece.times[j])(self.times[i] - piece.times[j])
            answer.displacement[:, i], answer.velocity[:, i] = y[: self.n], y[self.n : 2 * self.n]
        return max(shown, int(last))


@dataclass(frozen=True)
class _Piece:
    times: np.ndarray
    states: np.ndarray
    y: np.ndarray
    t: float
    k: int
    event: bool
