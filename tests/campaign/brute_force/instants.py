"""Instants for brute force: impacts and what closes after them, decided by trying every set of contacts."""

import itertools

import numpy as np

from brute_force.levels import STEP
from brute_force.sliding import SIGNS
from brute_force.system import NoAnswer

ZERO = 1e-12  # of the lengths and speeds of the scene: what is at a stop
MOMENT = 1e-3  # of a step: after which a set of closed contacts is looked at
SOONER = (1e-5, 1e-7, 1e-9)  # the same where no set is admissible: a slip may be over before
ROUND_OFF = 1e-15  # of the terms of a gap: it is zero
BACKWARDS = 1e-9  # of the speed of the scene: a slip against its direction is no round-off
CLEAR = 1e-10  # of the terms of a limit and a force: the force is within it
DEPENDENT = 1e-10  # of the largest: an eigenvalue of the contacts' flexibility that is none


class Instants:
    """What follows an instant. length, speed: of the scene [m, m/s]; touch: of the length, see TOUCH."""

    def __init__(self, levels, length, speed, touch):
        self.levels, self.length, self.speed, self.touch = levels, length, speed, touch
        self.n, self.rows, self.inverse = levels.n, levels.rows, levels.inverse

    def settled(self, before, y, t, answer, again=False):
        """The state after an instant, and y behind its impacts.

        again: it has come back at once: what round-off has allowed, by little, is not allowed any more.
        """
        allowed = 0.0 if again else ZERO
        w = self.levels.behind(t)
        touching = self._touching(y, w)
        y = self._without_drift(y, w, touching)
        y = self._struck(y, w, touching, answer)
        resting = [i for i in touching if abs(self._rate(i, y, w)) <= ZERO * self.speed * 10]
        for moment in (MOMENT, *SOONER) if self.levels.system.sliders else (MOMENT,):
            best, worst = self._least_violating(before, resting, y, t, moment, allowed)
            if worst <= allowed:
                break
        fallen = self.levels.sliding.fallen(before, y, w)
        if worst > ZERO and fallen is not y:  # sticks again with the limit that it has fallen to
            best, worst = self._least_violating(before, resting, fallen, t, MOMENT, ZERO)
        if best is None or worst > 1e-3:
            raise NoAnswer(f"no admissible set at t = {t:g}")
        answer.rubbed += self.levels.sliding.let_go(before, best[0], y, w)
        for i, (old, new) in enumerate(zip(before, best[0], strict=True)):
            if old != new and (i < self.levels.c or t > 0):
                answer.events.append((t, i, new))
        return best

    def _least_violating(self, before, resting, y, t, moment, allowed):
        """(state, y in it) whose motion is admissible a moment later, or is most nearly, and by how much it is not.

        Of several, as where friction wedges a contact that may open as well, the one in which fewest contacts change.
        """
        w, best, worst = self.levels.behind(t), None, np.inf
        every = [held for count in range(len(resting) + 1) for held in itertools.combinations(resting, count)]
        for slides in self.levels.sliding.choices(before, y, w, self.speed, resting):
            for held in sorted(every, key=lambda held: sum((before[i] == "closed") != (i in held) for i in resting)):
                if worst <= allowed or not self._independent(held, slides):
                    continue
                state = self._compliant(before, held, slides, y, t)
                after = self.levels.sliding.entered(before, state, y, w)
                violation = self._violation(state, resting, after, t, moment)
                if violation < worst:
                    best, worst = (state, after), violation
        return best, worst

    def at_rest(self, before, y, t, slow):
        """y behind ever faster impacts of several contacts in turn, which end at rest at all of them.

        slow: of the scene's speeds, at which they do. So does what rubs without a spring, there or elsewhere, that
        every impact has moved, and that is as slow. What slides on is pushed with mu times the impulse of its contact:
        that of all impacts left, which is a pull where the contact has just been left and forces lead back to it.
        """
        w = self.levels.behind(t)
        struck = [i for i in self._touching(y, w) if abs(self._rate(i, y, w)) <= slow * self.speed]
        if not struck:
            return y
        sliders, first = self.levels.system.sliders, self.levels.sliding.first
        rubs = [e for e in range(len(sliders)) if before[first + e] != "off" or sliders[e].contact in struck]
        rubs = [e for e in rubs if self.levels.sliding.rigid(e)]
        rubs = [e for e in rubs if abs(self._passing(e, y, w)) <= slow * self.speed * np.sum(np.abs(sliders[e].row))]
        rows = np.array([self.rows[i] for i in struck] + [sliders[e].row for e in rubs])
        pushes = rows.copy()
        for e, slider in enumerate(sliders):
            if e not in rubs and self._rubs(e, struck):
                sign = np.sign(self._passing(e, y, w))
                pushes[struck.index(slider.contact)] -= sign * slider.limit * slider.row
        u = np.array([self._rate(i, y, w) for i in struck] + [self._passing(e, y, w) for e in rubs])
        impulses = -np.linalg.pinv(rows @ self.inverse @ pushes.T, rcond=DEPENDENT) @ u
        y = y.copy()
        y[self.n : 2 * self.n] += self.inverse @ pushes.T @ impulses
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
        return self.levels.system.stops[i].gap - (0.0 if self.levels.ways[i] is None else w[self.levels.ways[i]])

    def _touching(self, y, w):
        gaps = self.rows @ y[: self.n] + [s.gap for s in self.levels.system.stops]
        gaps -= [0.0 if k is None else w[k] for k in self.levels.ways]
        near = [i for i in self.levels.rigid if gaps[i] <= 10 * self.touch * self.length * np.sum(np.abs(self.rows[i]))]
        if any(gaps[i] < -1e-6 * self.length for i in near):
            raise NoAnswer("inside a rigid stop")
        return near

    def _rate(self, i, y, w):
        return self.rows[i] @ y[self.n : 2 * self.n] - (
            0.0 if self.levels.speeds[i] is None else w[self.levels.speeds[i]]
        )

    def _independent(self, held, slides=()):
        sliding = self.levels.sliding
        rows = [self.rows[i] for i in held]
        rows += [sliding.all[e].row for e, state in enumerate(slides) if state == "stick" and sliding.rigid(e)]
        if not rows:
            return True
        values = np.linalg.eigvalsh(np.array(rows) @ self.inverse @ np.array(rows).T)
        return values[0] > DEPENDENT * values[-1]

    def _struck(self, y, w, touching, answer):
        """Moreau's impact: p >= 0, speeds u >= 0 (and e times those before), p u = 0, and |q| <= mu p of what rubs.

        Where any rubs with restitution, Poisson's: all without it first, then p >= e times that impulse.
        """
        u = np.array([self._rate(i, y, w) for i in touching])
        if not len(u) or np.min(u) >= -ZERO * self.speed:
            return y
        back = np.array([self.levels.system.stops[i].restitution for i in touching])
        rough = any(self._rubs(e, touching) for e in range(len(self.levels.system.sliders)))
        if not (rough and np.any(back)):
            return self._pushed(y, w, touching, np.zeros(len(u)), -back * u, answer)[0]
        y, first = self._pushed(y, w, touching, np.zeros(len(u)), np.zeros(len(u)), answer)
        return self._pushed(y, w, touching, back * first, np.zeros(len(u)), answer)[0]

    def _pushed(self, y, w, touching, least, wanted, answer):
        """y after impulses, and those of the contacts that touch: at least ``least``, and ``wanted`` speeds after it.

        By trying every set of contacts that push, and whether each of them that rubs then sticks or slides, and where.
        """
        best = np.inf, None, None
        for count in range(len(touching) + 1):
            for pushed in itertools.combinations(touching, count):
                loaded = [i for i, p in zip(touching, least, strict=True) if i in pushed or p > 0]
                rough = [e for e in range(len(self.levels.system.sliders)) if self._rubs(e, loaded)]
                for slides in itertools.product(("stick", *SIGNS), repeat=len(rough)):
                    given = y, w, touching, pushed, dict(zip(rough, slides, strict=True)), least, wanted
                    violation, rows, p = self._impulses(*given)
                    if violation < 0.1 * best[0]:
                        best = max(violation, ZERO / 10), rows, p
        if best[0] > 1e-8:
            raise NoAnswer("no admissible impact")
        y, before = y.copy(), y
        y[self.n : 2 * self.n] += self.inverse @ best[1].T @ best[2]
        for i, p in zip(touching, best[2][: len(touching)], strict=True):
            answer.impact -= 0.5 * p * (self._rate(i, before, w) + self._rate(i, y, w))
            y[2 * self.n + i] += p
        return y, best[2][: len(touching)]

    def _rubs(self, e, contacts):
        """Whether one of these rigid contacts rubs with the slider, which bears an impulse then."""
        return self.levels.system.sliders[e].contact in contacts and self.levels.sliding.rigid(e)

    def _impulses(self, y, w, touching, pushed, slides, least, wanted):
        """By how much an impact violates its law, of the scene's speed; rows, and impulses along them.

        pushed: the contacts that push with more than their least. slides: of the sliders of those with an impulse. Rows
        are those of all that touch, then the sliders'.
        """
        sliders = self.levels.system.sliders
        if not self._independent(pushed):
            return np.inf, None, None
        rows = np.array([self.rows[i] for i in touching] + [sliders[e].row for e in slides])
        speeds = np.array([self._rate(i, y, w) for i in touching] + [self._passing(e, y, w) for e in slides])
        wanted = np.append(wanted, np.zeros(len(slides)))
        flexibility, matrix = rows @ self.inverse @ rows.T, np.eye(len(rows))
        asked = np.zeros(len(rows))
        for k, i in enumerate(touching):
            if i in pushed:
                matrix[k], asked[k] = flexibility[k], wanted[k] - speeds[k]
            else:
                asked[k] = least[k]
        for k, (e, state) in enumerate(slides.items(), start=len(touching)):
            if state == "stick":
                matrix[k], asked[k] = flexibility[k], -speeds[k]
            else:
                matrix[k, touching.index(sliders[e].contact)] = SIGNS[state] * sliders[e].limit
        if np.linalg.cond(matrix) > 1 / DEPENDENT:
            return np.inf, None, None
        p = np.linalg.solve(matrix, asked)
        after, size, count = speeds + flexibility @ p, np.max(np.diag(flexibility)), len(touching)
        wrong = [np.max(least - p[:count]) * size, np.max(wanted - after, where=np.arange(len(p)) < count, initial=0.0)]
        for k, (e, state) in enumerate(slides.items(), start=count):
            limit = sliders[e].limit * p[touching.index(sliders[e].contact)]
            wrong.append((abs(p[k]) - limit) * size if state == "stick" else -SIGNS[state] * after[k])
        return max(0.0, *wrong) / self.speed, rows, p

    def _passing(self, e, y, w):
        """Speed at which a slider passes its counter-surface."""
        row, row_w = self.levels.sliding.rate(e)
        return row @ y + row_w @ w

    def moment(self, t, share=MOMENT):
        """A short time [s]: of the fastest motion, less where loads change within a step."""
        k = min(int(np.searchsorted(self.levels.nodes, t, side="right")), len(self.levels.nodes) - 1)
        return (
            share
            * STEP
            / self.levels.rate_of_all
            * float(np.clip(100 * (self.levels.nodes[k] - t) * self.levels.rate_of_all, 0.02, 1))
        )

    def _compliant(self, before, held, slides, y, t):
        """The state with these rigid contacts closed: the others by where they are, or will be a moment later.

        slides: states of the sliders, of those whose contacts are closed.
        """
        state, sliding, w = list(before), self.levels.sliding, self.levels.behind(t)
        state[sliding.first :] = slides
        for i in self.levels.rigid:
            state[i] = "closed" if i in held else "open"
        for _ in range(6):
            for e, slider in enumerate(sliding.all):
                shut = slider.contact is None or state[slider.contact] == "closed"
                state[sliding.first + e] = slides[e] if shut else "off"
            level, tau, known = self.levels.level(tuple(state)), self.moment(t), tuple(state)
            later = self.levels.inside(level, sliding.entered(before, known, y, w), t)(tau)
            now, then = self.levels.behind(np.array([t, t + tau]))
            for i, stop in enumerate(self.levels.system.stops):
                if i not in self.levels.rigid:
                    state[i] = self._by_place(i, stop, (y, now), (later, then))
            for j, law in enumerate(self.levels.system.laws):
                q = law.row @ y[: self.n]
                if np.min(np.abs(law.knots - q)) <= ZERO * self.length:
                    q = law.row @ later[: self.n]
                state[self.levels.c + j] = int(np.clip(np.searchsorted(law.knots, q) - 1, 0, len(law.knots) - 2))
            if tuple(state) == known:
                break
        return tuple(state)

    def _by_place(self, i, stop, now, later):
        def gap(at):
            return (
                self.rows[i] @ at[0][: self.n]
                + stop.gap
                - (0.0 if self.levels.ways[i] is None else at[1][self.levels.ways[i]])
            )

        g = gap(now)
        place = now if abs(g) > ZERO * self.length else later
        g = gap(place)
        if g > 0 or not stop.damping:
            return "open" if g > 0 else "closed"
        force = -stop.stiffness * g - stop.damping * self._rate(i, *place)
        if abs(force) <= ZERO * (stop.stiffness * self.length + stop.damping * self.speed):
            force = -stop.stiffness * gap(later) - stop.damping * self._rate(i, *later)
        return "closed" if force > 0 else "inside"

    def _violation(self, state, resting, y, t, moment):
        """By how much the motion of a state leaves what is admissible a moment later, of what it could.

        Of what sticks, or slips, at once, too: it may be within its limit, or slip its way, again a moment later. What
        is clearly within its limit at once sticks, however soon it is beyond it.
        """
        first = self.levels.sliding.first
        if not resting and len(state) == first:
            return 0.0
        level, tau = self.levels.level(state), self.moment(t, moment)
        at = self.levels.inside(level, y, t)
        worst, held = 0.0, set()
        for share in (0.0, 0.5, 1.0):
            later = at(share * tau)
            w = self.levels.behind(t + share * tau)
            s = level.signals @ later + level.signal_inputs @ w
            sizes = level.sizes[0] @ np.abs(later) + level.sizes[1] @ np.abs(w)
            if share == 0:
                tight = {i for value, i, size in zip(s, level.turns, sizes, strict=True) if value <= CLEAR * size}
                held = {i for i in level.turns if i >= first and state[i] == "stick" and i not in tight}
            for value, i, size in zip(s, level.turns, sizes, strict=True):
                if i in held:
                    continue
                at_once = i >= first and state[i] == "stick" and self._pressed(i - first, level, y, t)
                if share == 0 and state[i] in SIGNS and value < -BACKWARDS * self.speed:
                    worst = max(worst, -value / self.speed)
                if at_once or (share > 0 and (i in resting or i >= first)):
                    if state[i] == "open":
                        value = value if abs(value) > ROUND_OFF * size else 0.0
                        size = self.length * (self.levels.rate_of_all * share * tau) ** 2
                    if state[i] in SIGNS:
                        value = value if abs(value) > ROUND_OFF * size else 0.0
                        size = self.speed * self.levels.rate_of_all * share * tau
                    worst = max(worst, -value / size if size else 0.0)
        return worst

    def _pressed(self, e, level, y, t):
        """Whether a slider has a limit that is more than round-off, which that of a contact that closes is."""
        slider = self.levels.system.sliders[e]
        stop = None if slider.contact is None else self.levels.system.stops[slider.contact]
        if stop is None or np.isinf(stop.stiffness) or stop.damping:
            return True
        most = level.limits[0][e] @ y + level.limits[1][e] @ self.levels.behind(t)
        return most > slider.static_limit * stop.stiffness * 10 * self.touch * self.length * np.sum(np.abs(stop.row))
