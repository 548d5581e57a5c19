"""What must hold of every run, whatever the scene: each check gives a complaint, or None.

They know the trajectory's analytic segments and nothing of how events were found. Between samples h apart a signal g
stays above min(g0, g1) - h^2/8 max|g''|; where that bound may lie below zero, the lowest value is looked for in
extended precision.
"""

import itertools

import numpy as np

import multiphi_exudyn as mp
from multiphi_exudyn.events.state import Phase

CLOSES = 1e-9  # of the largest energy: what the ledger may leave open, and what a row may be below zero
RUBBED = 1e-10  # the same where there is friction
NO_TRUNCATION = 1e-9  # of the largest energy: what a complete basis may lose between levels
MISSED = 1e-11  # of a signal's largest possible value: a dip that is no round-off
LAW = 1e-8  # of the same: a complete basis' violation of the law of contact
DIFFERENCE = 1e-3  # of a level's potential: energies are differences of it, with 1e-3 of CLOSES for round-off
PASSED = 1e-5  # the same of what a start or an instant passes through: a few round-offs of its potential
SMALLEST = 1e-6  # J, m: less is round-off in cases whose masses, stiffnesses and gaps are about 1
INSTANT = 1e-12  # of the run: a shorter segment has no times of its own
INSIDE = 5  # instants of a segment at which its reach is read
BLOCK = 2**18  # samples held at one time
POLISH = 41  # samples around a lowest one, ROUNDS times over
ROUNDS = 4

SLIPS_UP = 1  # a state of friction: stick is before it, slip downwards after it
EXPECTED_FAILURES = ("not independent of each other",)  # causes that are the scene's own


def complaints(run, samples=24.0, most=60, *, joule=1.0, metre=1.0, varying=False):
    """Everything that is wrong with a run.

    samples: per shortest period. most: segments. joule, metre: in its units. varying: loads or stops vary in time,
    whose work only the ledger knows.
    """
    if not run.segments:
        return [complaint for complaint in (status(run),) if complaint]
    looked_at = [*run.segments[: most // 2], *run.segments[max(most // 2, len(run.segments) - most // 2) :]]
    scale = largest_energy(run, looked_at, joule)
    checks = [status(run), ledger(run, scale), missed(run, looked_at, samples, metre)]
    if not varying:
        checks.append(energy(run, looked_at, scale))
    return [complaint for complaint in checks if complaint]


def status(run):
    """ "ok", or a failure that names an instant and a cause which lies in the scene."""
    if run.status == "ok":
        return None
    if not run.message.startswith("at t = ") or not any(cause in run.message for cause in EXPECTED_FAILURES):
        return f"status: {run.message}"
    return None


def largest_energy(run, segments, joule=1.0):
    """What round-off of energies is measured against [J]: the largest at the ends of these segments."""
    ledger = run.ledger
    times = np.unique([time for segment in segments for time in (segment.start, segment.end)])
    stored = np.max(np.abs(run.energy(times)))
    work = np.max(np.abs(_work(run, times)))
    rests = DIFFERENCE * max(map(_potential, segments))
    passed = PASSED * abs(run.model.level(()).asymptotic(run.load).potential)
    passed = max(passed, PASSED * max((abs(event.loss.truncation_strain) for event in run.events), default=0.0))
    return max(ledger.initial, abs(ledger.work_of_loads), float(stored), float(work), SMALLEST * joule, rests, passed)


def _potential(segment):
    """The larger one [J] of a level at rest, and where a segment starts: there a varying load has its present value."""
    start = segment.modal(np.array([segment.start]))[:, 0]
    return max(abs(segment.level.asymptotic.potential), abs(segment.level.potential(start)))


def ledger(run, scale):
    """It closes; impact, damping, friction and kinetic truncation take energy; without truncation no strain is lost.

    The strain row alone may be negative, and only in a truncated basis: an instant that leaves a gap which is not
    zero can stretch the spring of the level that it enters.
    """
    found = run.ledger
    rows = {"impact": found.impact, "truncation_kinetic": found.truncation_kinetic, "damping": found.damping}
    rows["friction"] = found.friction
    for name, value in rows.items():
        if not value >= -CLOSES * scale:
            return f"ledger: {name} {value:g} of {scale:g} J"
    if not abs(found.residual) <= (RUBBED if run.model.rubbing else CLOSES) * scale:
        return f"ledger: residual {found.residual:g} of {scale:g} J"
    if not abs(found.truncation_strain) + abs(found.truncation_kinetic) <= NO_TRUNCATION * scale and _complete(run):
        return f"ledger: truncation {found.truncation_strain:g}, {found.truncation_kinetic:g} of {scale:g} J"
    return None


def energy(run, segments, scale, samples=5):
    """Energy less the work of loads never rises; in a truncated basis within segments alone."""
    ends = [(segment.start, segment.end) for segment in segments if segment.end - segment.start > INSTANT * run.t_end]
    if not ends:
        return None
    inside = np.linspace(0, 1, samples + 2)[1:-1]
    times = np.array([start + inside * (end - start) for start, end in ends])
    left = (run.energy(times.ravel()) - _work(run, times.ravel())).reshape(times.shape)
    rises = np.diff(left.ravel()) if _complete(run) else np.diff(left, axis=1).ravel()
    returned = max((-event.loss.damping for event in run.events), default=0.0)  # by dampers
    worst = float(np.max(rises, initial=0.0)) - max(returned, 0.0)
    return f"energy: rises by {worst:g} J" if worst > NO_TRUNCATION * scale else None


def missed(run, segments, samples, metre=1.0):
    """No contact leaves its state's admissible range unheard: s >= 0 (events/decision.py) on every segment.

    In a truncated basis this is asked of armed contacts and of closed rigid ones, which never pull. Round-off is that
    of the whole run: an impact that stops all motion leaves a state that is round-off of the one before.
    """
    complete, largest, reach = _complete(run), {}, _reach(segments, SMALLEST * metre)
    looked_at = list(_signals(segments, run, complete))
    for segment, contact, _, signal in looked_at:
        key, own = (contact, signal.of), signal.size(segment.end - segment.start)
        most = np.max(np.abs(_load(run, segment))) if signal.of == "reaction" else reach * signal.per_metre()
        largest[key] = max(largest.get(key, 0.0), own, signal.arm * most)
    for segment, contact, heard, signal in looked_at:
        size = largest[contact, signal.of]
        lowest, at = signal.lowest(segment.end - segment.start, samples)
        unresolved = np.finfo(float).eps * segment.end * signal.steepness(at)
        if lowest < -(MISSED if heard else LAW) * size - unresolved:
            name = run.model.contacts[contact].name
            return f"missed: {name} at {segment.start + at:.9g} s, {lowest / size:g} of its size"
    return None


def _signals(segments, run, complete):
    """(segment, contact, whether it is armed, its signal) of all that is to be looked at."""
    for segment in segments:
        phases = iter(segment.phases)
        for contact, element in enumerate(run.model.contacts):
            link, state = run.model.link_places[contact][0], segment.level.states[contact]
            if len(run.model.link_places[contact]) > 1:  # a contact with friction: brute force judges it
                list(itertools.islice(phases, len(element.states[state].exits)))
                continue
            for made in _of(element, link in segment.level.level.indices, state):
                phase, signal = next(phases), Signal(segment, link, *made)
                if element.damping:
                    continue  # its signal is a force with a rate of its own: brute force judges it
                if segment.end > segment.start and (phase is Phase.ARMED or complete or signal.of == "reaction"):
                    yield segment, contact, phase is Phase.ARMED, signal


def _of(element, closed, state):
    """Of what an element's signals are made in a state, with which factor and constant."""
    if isinstance(element, mp.Friction):
        if closed:
            kind = "reaction" if element.rigid else "tension"
            return [(kind, s, element.most) for s in (1.0, -1.0)]
        return [("rate", 1.0 if state == SLIPS_UP else -1.0, 0.0)]
    if not closed:
        return [("gap", 1.0, 0.0)]
    return [("reaction", 1.0, 0.0) if element.rigid else ("gap", -1.0, 0.0)]


def _reach(segments, smallest):
    """The largest coordinate y of the run, within segments too: what a gap that never moves is the difference of."""
    times = [np.linspace(segment.start, segment.end, INSIDE) for segment in segments]
    places = [segment.level.configuration(segment.modal(t)) for segment, t in zip(segments, times, strict=True)]
    return max([smallest, *(float(np.max(np.abs(y), initial=0.0)) for y in places)])


class Signal:
    """s of a link on a segment: constant + Re sum a_j t^d_j exp(lambda_j t).

    of: what it is made of, a "gap", its "rate", a "reaction" or the "tension" of a spring. arm: what a coordinate, or
    a load, of 1 can at most make of it.
    """

    def __init__(self, segment, link, of, sign, constant):
        level = segment.level
        own, self.basis, modal, self.of = level.level, segment.basis, segment.rows, of
        row, self.arm, self.terms = own.base.directions[:, link], 1.0, abs(constant)
        if of in ("reaction", "tension"):
            k = own.indices.index(link)
            self.coefficients = own.force_rows[k] @ modal + own.force_rate_rows[k] @ self.basis.derivative(modal)
            self.constant = float(level.asymptotic.forces[k])
        else:
            self.coefficients = own.gap_rows[link] @ modal
            self.constant = float(level.gap_constants[link])
        if of == "rate":
            self.coefficients, self.constant = self.basis.derivative(self.coefficients), 0.0
        if of == "reaction":
            self.arm = float(np.sum(np.abs(row)) / (row @ row))
        else:
            row, self.arm = np.abs(row), float(np.sum(np.abs(row)))
        if of == "gap":
            self.terms = float(row @ (np.abs(own.vectors) @ np.sum(np.abs(modal), axis=1)))
            self.terms += float(row @ np.abs(level.asymptotic.configuration)) + abs(float(own.base.gaps[link]))
        self.coefficients, self.constant = sign * self.coefficients, sign * self.constant + constant
        self.stiffness = float(own.base.stiffnesses[link])

    def per_metre(self):
        """What a length of 1 can at most make of it: the fastest rate of a speed, the stiffness of a spring."""
        if self.of == "rate":
            return float(np.max(np.abs(self.basis.rates), initial=0.0))
        return self.stiffness if self.of == "tension" else 1.0

    def size(self, duration):
        """What round-off of s is measured against on [0, duration]: its bound, and what a gap is the sum of."""
        return max(self._bound(self.coefficients, duration) + abs(self.constant), self.terms)

    def _bound(self, coefficients, duration):
        growth = (
            np.exp(np.maximum(self.basis.rates.real, 0) * duration) * (duration / self.basis.unit) ** self.basis.powers
        )
        return float(np.abs(coefficients) @ growth)

    def __call__(self, t):
        return (self.basis.at(t) @ self.coefficients).real + self.constant

    def steepness(self, t):
        """|s'| at t: with the resolution of time it is what s may be at its root."""
        return float(np.abs((self.basis.at(t) @ self.basis.derivative(self.coefficients)).real))

    def exactly(self, t):
        """The same in extended precision."""
        wide = np.asarray(t, np.longdouble)[:, None]
        phi = np.exp(wide * self.basis.rates.astype(np.clongdouble)) * (wide / self.basis.unit) ** self.basis.powers
        return (phi @ self.coefficients.astype(np.clongdouble)).real + np.longdouble(self.constant)

    def lowest(self, duration, samples):
        """(lowest value on [0, duration], where); only the values below zero need be right."""
        fastest = np.max(np.abs(self.basis.rates), initial=0.0)
        curvature = self._bound(self.basis.derivative(self.basis.derivative(self.coefficients)), duration)
        if self.constant > self._bound(self.coefficients, duration):
            return self.constant - self._bound(self.coefficients, duration), 0.0
        count = int(np.ceil(samples * duration * fastest / (2 * np.pi))) + 8
        step, best = duration / count, (np.inf, 0.0)
        for first in range(0, count + 1, BLOCK):
            t = step * np.arange(first, min(first + BLOCK, count) + 1)
            g = self(t)
            doubtful = g < step**2 / 8 * curvature
            lower = np.r_[True, g[1:] <= g[:-1]] & np.r_[g[:-1] <= g[1:], True]
            best = min(best, (float(np.min(g)), float(t[np.argmin(g)])))
            for place in t[doubtful & lower]:
                if not self._falls_away(place, step * curvature, duration):
                    best = min(best, self._polished(place, step, duration))
        return best

    def _falls_away(self, place, change, duration):
        """Whether an end of the interval is the lowest place near it: the slope there cannot turn within a step."""
        if step_inside := int(place <= 0) - int(place >= duration):
            rate = self.basis.at(place) @ self.basis.derivative(self.coefficients)
            return step_inside * rate.real > change
        return False

    def _polished(self, place, step, duration):
        for _ in range(ROUNDS):
            t = np.linspace(max(place - step, 0.0), min(place + step, duration), POLISH)
            g = self.exactly(t)
            place, step = float(t[np.argmin(g)]), 2 * step / (POLISH - 1)
        return float(np.min(g)), place


def _complete(run):
    return run.model.modes == "all"


def _load(run, segment):
    """Constant loads (m,); those that pull at damped rigid-body motion are a channel (excitation.py)."""
    _, w = segment.level.split(segment.modal(np.array([segment.start])))
    return segment.level.excitation.load(w[:, 0])


def _work(run, times):
    """Work of the constant loads since the start [J]."""
    starts = np.array([segment.start for segment in run.segments])
    owner = np.maximum(np.searchsorted(starts, times, side="right") - 1, 0)
    work = np.empty(len(times))
    for k in np.unique(owner):
        segment, part = run.segments[k], owner == k
        moved = (
            segment.level.level.vectors @ segment.modal(times[part])
            + (segment.level.asymptotic.configuration - run.start.displacement)[:, None]
        )
        work[part] = _load(run, segment) @ moved
    return work
