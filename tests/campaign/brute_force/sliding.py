"""Sliders for brute force: their forces in every state, what may follow an instant, and what it makes of a state.

    stick   T' = k (h.x' - v), without a spring h.x' = v;   + and -   T = +-F;   off   T = 0, the slider's contact open

y holds T of the springs that stick, and the way that a slider has slid.
"""

import itertools

import numpy as np

MOST_ALIKE = 1e10  # condition of what is held together
TIMED = 1e-14  # of the run: the instant of a root is not known better
ZERO = 1e-11  # of the scene's speeds and of a limit: a slider is at rest, a spring is as tight as it may be
SIGNS = {"+": 1.0, "-": -1.0}


class Sliding:
    """Sliders beside the levels that they are part of; those at rest may stick or slip either way."""

    def __init__(self, levels):
        self.levels, self.all = levels, levels.system.sliders
        self.first = levels.c + len(levels.system.laws)  # in a state
        self.tension = 2 * levels.n + levels.c  # in y
        self.way = self.tension + len(self.all)

    def rigid(self, e):
        return bool(np.isinf(self.all[e].stiffness))

    def largest_tensions(self, length):
        """(f,) [N]: of springs, whose sliders may hang on contacts."""
        limited = [np.inf if slider.contact is not None else slider.static_limit for slider in self.all]
        sprung = [0.0 if self.rigid(e) else slider.stiffness * length for e, slider in enumerate(self.all)]
        return np.minimum(limited, sprung)

    def largest_stretch(self):
        """[m] of the structure under static limits that do not hang on contacts."""
        system = self.levels.system
        flexibility = np.linalg.pinv(system.stiffness, rcond=1e-9, hermitian=True)
        pulls = [slider.static_limit * flexibility @ slider.row for slider in self.all if slider.contact is None]
        return float(np.max(np.abs(pulls), initial=0.0))

    def rate(self, e):
        """Rows (y,) and (w,) of the speed h.x' - v of a slider's end on the structure."""
        slider, levels = self.all[e], self.levels
        row, row_w = np.zeros(levels.size), np.zeros(len(levels.functions))
        row[levels.n : 2 * levels.n], row_w[0] = slider.row, -slider.velocity
        if levels.slider_speeds[e] is not None:
            row_w[levels.slider_speeds[e]] -= 1
        return row, row_w

    def known(self, e, state, forces):
        """Rows (y,) and (w,) of T, where it is no reaction."""
        slider = self.all[e]
        row, row_w = np.zeros(self.levels.size), np.zeros(len(self.levels.functions))
        if state == "stick":
            row[self.tension + e] = 1.0
        elif state in SIGNS and slider.contact is None:
            row_w[0] = SIGNS[state] * slider.limit
        elif state in SIGNS:
            pressed = SIGNS[state] * slider.limit
            row, row_w = pressed * forces[0][slider.contact], pressed * forces[1][slider.contact]
        return row, row_w

    def most(self, e, forces):
        """Rows (y,) and (w,) of the static limit."""
        slider = self.all[e]
        if slider.contact is None:
            return np.zeros(self.levels.size), slider.static_limit * np.eye(1, len(self.levels.functions))[0]
        return slider.static_limit * forces[0][slider.contact], slider.static_limit * forces[1][slider.contact]

    def slip_rate(self, e, state, tensions, matrix, inputs):
        """Rows of the slider's own speed: that of its end less that of its spring, T'/k."""
        row, row_w = self.rate(e)
        if state in SIGNS and not self.rigid(e):
            tension, tension_w = tensions[0][e], tensions[1][e]
            row = row - tension @ matrix / self.all[e].stiffness
            row_w = row_w - (tension @ inputs + tension_w @ self.levels.input_rates) / self.all[e].stiffness
        return row, row_w

    def fill(self, slides, matrix, inputs, forces, tensions):
        """Rows of limits and of the sliders' own speeds; the level's matrices are given those of springs and ways."""
        for e, state in slides.items():
            if state == "stick" and not self.rigid(e):
                row, row_w = self.rate(e)
                matrix[self.tension + e] = self.all[e].stiffness * row
                inputs[self.tension + e] = self.all[e].stiffness * row_w
        limits = [self.most(e, forces) for e in slides]
        slips = [self.slip_rate(e, state, tensions, matrix, inputs) for e, state in slides.items()]
        for e, state in slides.items():
            if state in SIGNS:
                matrix[self.way + e], inputs[self.way + e] = (SIGNS[state] * row for row in slips[e])
        return _columns(limits), _columns(slips)

    def signals(self, slides, tensions, limits, slips):
        """(row (y,), row (w,), item) of what lasts as long as it is positive."""
        for e, state in slides.items():
            for s in SIGNS.values() if state == "stick" else ():
                yield limits[0][e] - s * tensions[0][e], limits[1][e] - s * tensions[1][e], self.first + e
            if state in SIGNS:
                yield SIGNS[state] * slips[0][e], SIGNS[state] * slips[1][e], self.first + e

    def sizes(self, state, signals, turns, limits, tensions):
        """Rows of what round-off of signals is measured against: a limit less a tension, each with its own terms."""
        sizes = tuple(np.abs(rows) for rows in signals)
        for k, i in enumerate(turns):
            if i >= self.first and state[i] == "stick":
                for size, limit, tension in zip(sizes, limits, tensions, strict=True):
                    size[k] = np.abs(limit[i - self.first]) + np.abs(tension[i - self.first])
        return sizes

    def choices(self, before, y, w, speed, touching):
        """All that the sliders may do after an instant, as tuples of their states, those that follow first.

        Several may be admissible where static limits are higher. First is what static limits leave, see ``_fallen``.
        """
        level = self.levels.level(before)
        options, asking = [], []
        for e, slider in enumerate(self.all):
            state = before[self.first + e]
            own, asks = self._options(e, state, level, y, w, speed)
            options.append(own)
            asking.append(asks)
            if slider.contact is not None:
                asking[-1] = asks or before[slider.contact] != "closed"

        fallen = self._fallen(before, options, y, w, touching)

        def order(states):
            changed = [states[e] != before[self.first + e] for e in range(len(states))]
            idle = sum(c and not a for c, a in zip(changed, asking, strict=True))
            return states != fallen, idle, sum(state != "stick" for state in states), sum(changed)

        return sorted(itertools.product(*options), key=order)

    def _fallen(self, before, options, y, w, touching):
        """States of the sliders after they have borne up to their static limits, and fallen from them; or None.

        Those at rest bear up to these limits, complementary to their accelerations and to the contacts that touch. Of
        those that do not hold, the ones that had slipped fall first to their limits, and all is looked at once more.
        """
        level, falls, held = self.levels.level(before), {}, set(touching)
        rests = [e for e, own in enumerate(options) if len(own) == 3 and before[self.first + e] != "off"]
        pressed = any(self.all[e].contact in self.levels.rigid for e in rests)  # its limit is no number yet
        if not rests or pressed or len(rests) + len(held) < 2:
            return None
        known = level.matrix @ y + level.inputs @ w
        free = known[self.levels.n : 2 * self.levels.n].copy()
        for i in self.levels.rigid:
            if before[i] == "closed":
                free -= self.levels.inverse @ self.levels.rows[i] * known[2 * self.levels.n + i]
        most = level.limits[0] @ y + level.limits[1] @ w
        for e in rests:
            free += self.levels.inverse @ self.all[e].row * (level.tensions[0][e] @ y + level.tensions[1][e] @ w)
        while True:
            found = self._complementary(free, rests, sorted(held), most, falls)
            if found is None:
                return None
            slips = {e: s for e, s in found.items() if s != "stick" and e not in falls}
            slips = {e: s for e, s in slips.items() if self.all[e].static_limit > self.all[e].limit}
            first = {e: s for e, s in slips.items() if before[self.first + e] in SIGNS} or slips
            if not first:
                return tuple(found.get(e, own[0]) for e, own in enumerate(options))
            falls |= first

    def _complementary(self, free, rests, touching, most, falls):
        """States of sliders at rest whose accelerations and forces, within ``most``, agree; None where none do.

        falls: states of those that slip with their limits. free: x'' (n,) without these sliders and these contacts.
        Where forces are not unique, those that would fall bear less than they may: they stay.
        """
        inverse, size = self.levels.inverse, np.max(np.abs(free), initial=0.0)

        def dropped(states):
            loose = [e for e, state in zip(rests, states, strict=True) if state != "stick" and e not in falls]
            return sum(most[e] * (1 - self.all[e].limit / self.all[e].static_limit) for e in loose)

        every = itertools.product(*([falls[e]] if e in falls else ["stick", *SIGNS] for e in rests))
        for states in sorted(every, key=dropped):
            slides = dict(zip(rests, states, strict=True))
            moved = free.copy()
            for e, state in slides.items():
                share = self.all[e].limit / self.all[e].static_limit if e in falls else 1.0
                moved -= SIGNS.get(state, 0.0) * share * most[e] * inverse @ self.all[e].row
            stuck = [e for e in rests if slides[e] == "stick"]
            for count in range(len(touching) + 1):
                for closed in itertools.combinations(touching, count):
                    rows = np.array([self.all[e].row for e in stuck] + [self.levels.rows[i] for i in closed])
                    rows = rows.reshape(-1, self.levels.n)
                    if len(rows) and np.linalg.cond(rows @ inverse @ rows.T) > MOST_ALIKE:
                        continue
                    forces = -np.linalg.solve(rows @ inverse @ rows.T, rows @ moved)
                    after = moved + inverse @ rows.T @ forces
                    bears = [most[e] - abs(f) for e, f in zip(stuck, forces[: len(stuck)], strict=True)]
                    bears += list(forces[len(stuck) :])
                    rises = [
                        SIGNS[s] * (self.all[e].row @ after) for e, s in slides.items() if s in SIGNS and e not in falls
                    ]
                    rises += [self.levels.rows[i] @ after for i in touching if i not in closed]
                    if (
                        min(bears, default=0.0) >= -ZERO * max([1e-300, *most])
                        and min(rises, default=0.0) >= -ZERO * size
                    ):
                        return slides
        return None

    def _options(self, e, state, level, y, w, speed):
        """States that a slider may enter, and whether it asks for one itself."""
        tension = level.tensions[0][e] @ y + level.tensions[1][e] @ w
        most = level.limits[0][e] @ y + level.limits[1][e] @ w
        if self.rigid(e):
            row, row_w = self.rate(e)
            moving, turning = row @ y + row_w @ w, row @ (level.matrix @ y + level.inputs @ w)
            if abs(moving) > ZERO * speed + TIMED * self.levels.nodes[-1] * abs(turning):
                return ["+" if moving > 0 else "-"], True
            return ["stick", "+", "-"], state != "stick" or abs(tension) >= most * (1 - ZERO)
        if state in SIGNS:
            row, row_w = level.slips[0][e], level.slips[1][e]
            if SIGNS[state] * (row @ y + row_w @ w) > ZERO * speed:
                return [state], True
            return ["stick", state], True
        tight = [sign for sign, s in SIGNS.items() if s * tension >= most * (1 - ZERO)]
        return ["stick", *tight], bool(tight)

    def fallen(self, before, y, w):
        """y where springs at their static limits have fallen to their smaller ones; y itself where none have."""
        level, after = self.levels.level(before), y
        for e, slider in enumerate(self.all):
            sprung = before[self.first + e] == "stick" and not self.rigid(e) and slider.static_limit > slider.limit
            tension = level.tensions[0][e] @ y + level.tensions[1][e] @ w
            most = level.limits[0][e] @ y + level.limits[1][e] @ w
            if sprung and abs(tension) >= most * (1 - ZERO):
                after = y.copy() if after is y else after
                after[self.tension + e] *= slider.limit / slider.static_limit
        return after

    def let_go(self, before, state, y, w):
        """Energy [J] that springs lose where their sliders begin to slip, from a static limit to a smaller one."""
        known, lost = self.levels.level(before), 0.0
        for e, slider in enumerate(self.all):
            if before[self.first + e] == "stick" and state[self.first + e] in SIGNS and slider.contact is None:
                tension = known.tensions[0][e] @ y + known.tensions[1][e] @ w
                lost += 0.0 if self.rigid(e) else (tension**2 - slider.limit**2) / (2 * slider.stiffness)
        return lost

    def entered(self, before, state, y, w):
        """y where sliders have changed: a spring keeps its tension, what sticks has no speed left of round-off."""
        y, known = y.copy(), self.levels.level(before)
        held = []
        for e in range(len(self.all)):
            old, new = before[self.first + e], state[self.first + e]
            if not self.rigid(e):
                y[self.tension + e] = known.tensions[0][e] @ y + known.tensions[1][e] @ w if new == "stick" else 0.0
            elif new == "stick" and old != "stick":
                held.append(e)
        if held:
            n, inverse = self.levels.n, self.levels.inverse
            rows = np.array([self.all[e].row for e in held])
            rates = np.array([row @ y + row_w @ w for row, row_w in map(self.rate, held)])
            y[n : 2 * n] -= inverse @ rows.T @ np.linalg.pinv(rows @ inverse @ rows.T, rcond=1e-10) @ rates
        return y


def _columns(pairs):
    """Pairs of rows as a pair of arrays."""
    return tuple(np.array([pair[k] for pair in pairs]) for k in (0, 1))
