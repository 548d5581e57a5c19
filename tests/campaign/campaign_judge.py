"""What is to be said of a scene's answer: the run against brute force, its own laws, itself in two parts, in Exudyn.

A difference is excused only by a motion that is sensitive by itself: a run nudged by 1e-12 must drift away no later,
and in more than one event. Nudges scale the start and the stiffness matrix, so that what is zero by structure stays
zero; no nudge excuses a status.
"""

from dataclasses import dataclass, replace

import brute_force
import campaign_bodies
import numpy as np
from campaign_scenes import later, scaled
from campaign_scenes.parts import NEAR
from lawful import complaints

import multiphi_exudyn as mp
from multiphi_exudyn.study.law_check import broken_laws
from reference_models.body_alone import solve_body_alone

NO_MOTION = 1e-6  # of a scene's length and speed
NUDGE = 1e-12  # of the start and of the stiffness
DRIFTED = 1e-10  # of the largest value: what a sensitive motion has drifted before the event that makes it NEAR
INSTANTS = 60  # at which motions are compared
DIGEST = 8  # of them are kept for a comparison of processors
AT_EVENT = 1e-7  # of the run: closer to an event, velocities are not compared
OTHERWISE = (  # brute force is tried so where it and the run differ: another touch, shorter steps, more bounces
    {"touch": 1e-12, "rocking": 20, "slow": 1e-9},
    {"touch": 1e-12},
    {"touch": 1e-10},
    {"finer": 2},
    {"finer": 8},
    {"rocking": 20},
)
IMPULSE = 1e-5  # of the largest: what momentum may miss, of which a truncated load misses more than motion
PULLING = 1e-8  # of a contact's largest force: round-off of a release
RUBBED = 1e-6  # of the energy: what friction takes
BODY_STEPS = 400  # of the Exudyn body, each of which ends exactly
BODY_NUDGE = 1e-9  # of the start and of the stiffness: what Newton's iterations leave of a state
BODY_SHARE = 16  # one scene in so many runs in the body too, and in two parts,
RUBBING_SHARE = 2  # of those with friction one in so many
FEW_DIGITS = ("digits:",)  # of warnings: the run is of other matrices than those that were printed
FAR_REST = (*FEW_DIGITS, "open ledger:", "slow mode:")  # of warnings where an equilibrium lies far away
NOT_UNIQUE = (
    "redundant friction",
    "friction in turn",
    "several impacts",
)  # of warnings that say that a run has no one answer
MIDDLE = 0.437  # of the run, where that ends and goes on


@dataclass(frozen=True)
class Motion:
    """x, x' (n, k) in the scene's own numbers up to where the run came, its events, and the impulse of its contacts.

    given: loads, x and x' of each of the runs. rubbed: energy [J] that friction has lost, None where brute force does
    not say.

    scale: a length [m] and a speed [m/s] of the scene; motion below a millionth of them counts as none.
    """

    status: str
    message: str
    displacement: np.ndarray
    velocity: np.ndarray
    events: int
    impulse: np.ndarray | None
    runs: tuple
    scale: tuple[float, float] = (0.0, 0.0)
    rubbed: float | None = 0.0
    given: tuple = ()


def instants(scene):
    """Times (k,) at which motions are compared, none of them a round part of the run."""
    return scene.t_end * (np.arange(INSTANTS) + 0.637) / INSTANTS


def judged(scene):
    """([(kind, cause), ...], digest) of a scene."""
    if scene.in_exudyn:
        found = campaign_bodies.JUDGES[scene.in_exudyn](scene)
        return found, [found[0][0], 0, []]
    try:
        motion = native(scene)
    except mp.MultiPhiError as refusal:
        return [("refused", str(refusal))], ["refused", 0, []]
    found, motion = _verdicts(scene, motion)
    return found, digest(motion)


def native(scene):
    """The package's answer; where the scene is split, every part begins at the end of the one before."""
    model, t_end, x, v, loads = scaled(scene)
    time, length, _ = (2.0**power for power in scene.units)
    runs, given, columns, first = [], [], [], 0.0
    for last in (*(t * time for t in scene.split), t_end):
        given.append(([later(load, first) for load in loads], x, v))
        run = mp.simulate(model, last - first, x, v, given[-1][0])
        runs.append(run)
        wanted = instants(scene) * time - first
        wanted = wanted[(wanted >= 0) & (wanted <= run.t_end) & (wanted < last - first)] if run.segments else []
        if len(wanted):
            columns.append((run.displacement(wanted) / length, run.velocity(wanted) * (time / length)))
        if run.status != "ok":
            break
        x, v, first = run.displacement(run.t_end), run.velocity(run.t_end), last
    n = len(x)
    places, speeds = (np.hstack([c[k] for c in columns]) if columns else np.zeros((n, 0)) for k in (0, 1))
    events = sum(len(run.events) for run in runs)
    motion = Motion(runs[-1].status, runs[-1].message, places, speeds, events, _impulse(scene, runs), tuple(runs))
    return replace(motion, given=tuple(given), rubbed=_rubbed(scene, runs))


def _rubbed(scene, runs):
    time, length, mass = (2.0**power for power in scene.units)
    joule = mass * (length / time) ** 2
    return sum(run.ledger.friction for run in runs if run.segments) / joule


def _impulse(scene, runs):
    """Sum of h_i p_i (n,) [N s], unique where the contacts' shares are not; None of truncated runs and laws."""
    if scene.system is None or scene.system.laws or any(run.status != "ok" for run in runs):
        return None
    time, length, mass = (2.0**power for power in scene.units)
    total = np.zeros(len(scene.system.mass))
    for contact, stop in zip(runs[0].model.contacts, scene.system.stops, strict=False):
        ends = [*(np.nextafter(run.t_end, 0.0) for run in runs[:-1]), runs[-1].t_end]  # what ends one, begins the next
        total += stop.row * sum(
            run.contact_impulse(contact.name, 0.0, end) for run, end in zip(runs, ends, strict=True)
        )
    return total * time / (length * mass)


def digest(motion):
    """Status, number of events and some displacements: what has to be the same on every processor.

    Round-off that is no motion is zero.
    """
    every = max(1, INSTANTS // DIGEST)
    status = motion.status if motion.status == "ok" else motion.message.split(": ", 1)[-1].split(" ")[0]
    values = motion.displacement[:, ::every].ravel()
    if np.max(np.abs(values), initial=0.0) <= NO_MOTION * motion.scale[0]:
        values = np.zeros_like(values)
    return [status, motion.events, [float(f"{value:.10g}") for value in values]]


def _verdicts(scene, motion):
    """Verdicts of a motion, and the motion with the scale of the scene where brute force says it."""
    if "chatter" in motion.message:
        return [("chatter", motion.message)], motion
    if scene.kind == "plain":  # no failure of its run is its own
        told_of = [text for run, given in zip(motion.runs, motion.given, strict=True) for text in laws_of(run, *given)]
        found = [(f"failure: {text.split(':')[0]}", text) for text in told_of]
        return found or [("ok" if motion.status == "ok" else "named failure", motion.message)], motion
    if motion.status != "ok":
        return [("named failure", motion.message)], motion
    if scene.by_laws:
        given = zip(motion.runs, motion.given, strict=True)
        broken = [text for run, (loads, x, v) in given for text in broken_laws(run, loads, (x, v))]
        verdict = "told: {}" if told(motion) else "failure: {}"
        return [(verdict.format(text.split(":")[0]), text) for text in broken] or [("ok", motion.message)], motion
    nearly_free = scene.kind == "nearly free"
    warned = told(motion, FAR_REST if nearly_free else FEW_DIGITS)
    compared, scale = _compared(scene, motion)
    wrong = any(kind.startswith("failure") for kind, _ in compared)
    small = nearly_free and not wrong  # round-off of a far rest, by which the motion is no other
    verdict = "told: {}" if warned else "small: {}" if small else "failure: {}"
    found = [
        (verdict.format(text.split(":")[0]), text)
        for run, given in zip(motion.runs, motion.given, strict=True)
        for text in laws_of(run, *given)
    ]
    for kind, text in compared:
        excused = kind == "failure: wrong" and told(motion)
        excused |= kind.startswith("failure") and warned and nearly_free
        found.append(("told" if excused else kind, text))
    rubs = scene.system is not None and scene.system.sliders
    looked_at = scene.number % (RUBBING_SHARE if rubs else BODY_SHARE) == 0 and not scene.split
    motion = replace(motion, scale=scale)
    if not found and looked_at:
        found += in_two_parts(scene, motion)
    if not found and looked_at and scene.units == (0, 0, 0):
        found += in_the_body(scene, motion)
    return found or [("ok", motion.message)], motion


def told(motion, kinds=NOT_UNIQUE):
    """Whether a run says itself that friction has no one answer, or gives another warning of these kinds."""
    return any(text.startswith(kinds) for run in motion.runs for text in run.warnings)


def laws_of(run, loads, x, v):
    """What must hold of every run (study/law_check.py)."""
    return complaints(run, loads, (x, v))


def _compared(scene, motion):
    """The motion against brute force, and the scale of that; of a truncated model against itself with its degrees of
    freedom in another order, without a scale.
    """
    if scene.system is None:
        other = native(reordered(scene, _order(scene)))
        places, speeds = np.argsort(_order(scene)), None
        other = replace(other, displacement=other.displacement[places], velocity=other.velocity[places])
        if other.status != motion.status:
            text = f"{motion.status}, in another order {other.status} {other.message}"
            return [("failure: order", text)], motion.scale
        return _difference(scene, motion, other, "failure: order", speeds), motion.scale
    start, times = scene.start or (scene.displacement, scene.velocity), np.append(instants(scene), scene.t_end)
    answer, reasons = None, []
    for setting in ({}, *OTHERWISE):
        try:
            answer = brute_force.solved(scene.system, *start, times, **setting)
            break
        except brute_force.NoAnswer as reason:
            reasons.append(str(reason))
    if answer is None:
        return [("unjudged", reasons[0])], motion.scale
    expected = motion_of(scene, answer)
    near = [np.min(np.abs(t - np.array([e[0] for e in answer.events])), initial=np.inf) for t in instants(scene)]
    found = _difference(scene, motion, expected, "failure: wrong", np.array(near) > AT_EVENT * scene.t_end)
    if found and found[0][0] == "failure: wrong":
        found = _otherwise(scene, motion, start, times, expected, found)
    return found, expected.scale


def _otherwise(scene, motion, start, times, expected, found):
    """What is to be said, which is not ``found`` where brute force hangs on how it is set."""
    for setting in OTHERWISE:
        try:
            other = motion_of(scene, brute_force.solved(scene.system, *start, times, **setting))
        except brute_force.NoAnswer:
            continue
        if np.max(_errors(scene, motion, other)) <= scene.near:
            return []
        if np.max(_errors(scene, other, expected)) > scene.near:
            return [("unjudged", "brute force has not converged")]
    return found


def motion_of(scene, answer):
    """Brute force's answer in the same form."""
    impulse = None
    if not scene.system.laws:
        impulse = sum(
            (s.row * p for s, p in zip(scene.system.stops, answer.impulse, strict=True)), 0 * answer.displacement[:, 0]
        )
    places, speeds = answer.displacement[:, :-1], answer.velocity[:, :-1]
    if scene.frame is not None:
        places, speeds = scene.frame @ places, scene.frame @ speeds
    scale = answer.length, answer.speed
    with_pressure = any(slider.contact is not None for slider in scene.system.sliders)
    rubbed = None if with_pressure else answer.rubbed
    return Motion("ok", "", places, speeds, len(answer.events), impulse, (), scale, rubbed)


def _difference(scene, motion, expected, kind, comparable):
    """What is to be said where two motions are not the same."""
    errors = _errors(scene, motion, expected, comparable)
    if np.max(errors, initial=0.0) > scene.near:
        at = int(np.argmax(errors > scene.near))
        cause = f"off by {np.max(errors):.3g} of the largest, from t = {instants(scene)[at]:.6g} s"
        cause += f" ({motion.events} events, {expected.events})"
        return [("sensitive", cause) if sensitive(scene, motion, at) else (kind, cause)]
    missing = 0.0
    if motion.impulse is not None and expected.impulse is not None:
        size = max(np.max(np.abs(expected.impulse)), _momentum(scene, expected), 1e-300)
        missing = float(np.max(np.abs(_shared_by_none(scene.system) @ (motion.impulse - expected.impulse)))) / size
    if missing > IMPULSE * scene.near / NEAR:
        return [("failure: impulse", f"off by {missing:.3g} of the largest momentum")]
    if found := _forces(scene, motion, expected, comparable):
        return found
    if expected.rubbed is not None and abs(motion.rubbed - expected.rubbed) > RUBBED * max(
        expected.rubbed, _energy(scene, expected)
    ):
        return [("failure: friction", f"takes {motion.rubbed:.9g} J, {expected.rubbed:.9g}")]
    return []


def _forces(scene, motion, expected, comparable):
    """What is to be said where forces are not those that brute force's motion makes, or where a contact pulls."""
    if scene.system is None or comparable is None or scene.frame is not None or scene.split:
        return []
    time, length, mass = (2.0**power for power in scene.units)
    run, times = motion.runs[0], instants(scene)[comparable]
    x, v = expected.displacement[:, comparable], expected.velocity[:, comparable]
    size = [
        max(np.max(np.abs(values), initial=0.0), scale) for values, scale in zip((x, v), expected.scale, strict=True)
    ]
    for contact, stop in zip(run.model.contacts, scene.system.stops, strict=False):
        force = run.contact_force(contact.name, times * time) * (time**2 / (length * mass))
        if np.min(force, initial=0.0) < -PULLING * np.max(np.abs(force), initial=0.0):
            return [("failure: pulls", f"{contact.name} with {-np.min(force):.3g} of {np.max(np.abs(force)):.3g} N")]
        if contact.rigid:
            continue
        z, rate = (np.zeros(len(times)) if stop.course is None else f(times) for f in _ways(stop))
        gap = stop.row @ x + stop.gap - z
        law = np.where(gap < 0, np.maximum(0.0, -stop.stiffness * gap - stop.damping * (stop.row @ v - rate)), 0.0)
        allowed = scene.near * np.sum(np.abs(stop.row)) * (stop.stiffness * size[0] + stop.damping * size[1])
        touching = (np.abs(gap) < scene.near * size[0]) & (stop.damping > 0)  # a damper's force jumps there
        off = np.where(touching, 0.0, np.abs(force - law))
        if np.max(off, initial=0.0) > allowed:
            at = times[int(np.argmax(off))]
            return [
                (
                    "failure: force",
                    f"{contact.name} off by {np.max(off):.3g} N at t = {at:.6g} s, {allowed:.3g} allowed",
                )
            ]
    return []


def _ways(stop):
    """z and z' of a stop as functions of time."""
    return (stop.course.value, stop.course.rate) if stop.course is not None else (None, None)


def _shared_by_none(system):
    """(n, n): leaves of an impulse what is not along blocks, where these follow from rigid contacts."""
    stops = [stop.row for stop in system.stops if np.isinf(stop.stiffness)]
    blocks = [slider.row for slider in system.sliders if np.isinf(slider.stiffness)]
    both = np.linalg.matrix_rank([*stops, *blocks], tol=1e-6) if stops and blocks else 0
    apart = sum(np.linalg.matrix_rank(rows, tol=1e-6) for rows in (stops, blocks) if rows)
    if not both or both == apart:
        return np.eye(len(system.mass))
    return np.eye(len(system.mass)) - np.linalg.pinv(blocks) @ np.array(blocks)


def _energy(scene, motion):
    """The largest kinetic one [J], or that of the slowest motion that counts."""
    if scene.frame is not None or scene.system is None:
        return 0.0
    speed, mass = motion.velocity, scene.system.mass
    kinetic = 0.5 * np.max(np.sum(speed * (mass @ speed), axis=0), initial=0.0)
    return max(float(kinetic), NO_MOTION * motion.scale[1] ** 2 * float(np.trace(mass)))


def _momentum(scene, motion):
    if scene.frame is not None:
        return 0.0
    return float(np.max(np.abs(scene.system.mass @ motion.velocity)))


def _errors(scene, motion, expected, comparable=None):
    """Of every instant, the larger of the errors of x and x', each of its largest value."""
    found, pairs = [], ((motion.displacement, expected.displacement), (motion.velocity, expected.velocity))
    for (ours, theirs), scale in zip(pairs, expected.scale, strict=True):
        if scene.shown is not None and len(ours) != len(theirs):
            ours = scene.shown @ ours
        count = min(ours.shape[1], theirs.shape[1])
        size = max(np.max(np.abs(theirs), initial=0.0), NO_MOTION * scale, 1e-300)
        found.append(np.max(np.abs(ours[:, :count] - theirs[:, :count]), axis=0, initial=0.0) / size)
    if comparable is not None:
        found[1] = np.where(comparable[: len(found[1])], found[1], 0.0)
    return np.maximum(*found)


def sensitive(scene, motion, at):
    """Whether nudged runs have drifted away by this instant, little by little."""
    for sign in (1, -1):
        other = native(nudged(scene, 1 + sign * NUDGE))
        if other.status != motion.status:
            return False
        errors = _errors(scene, other, motion)
        away = np.flatnonzero(errors > NEAR / 10)
        if len(away) and away[0] <= at + 1 and np.max(errors[: away[0]], initial=0.0) > DRIFTED:
            return True
    return False


def nudged(scene, factor):
    """The scene with its start and its stiffness times a factor near 1."""
    structure = replace(scene.model.structure, stiffness=factor * scene.model.structure.stiffness)
    given = replace(scene.model, structure=structure)
    return replace(scene, model=given, displacement=factor * scene.displacement, velocity=factor * scene.velocity)


def _order(scene):
    return np.roll(np.arange(scene.model.structure.n), 1)[::-1]


def reordered(scene, order):
    """The scene with its degrees of freedom in another order."""
    old, square = scene.model.structure, np.ix_(order, order)
    damping = old.damping[square] if isinstance(old.damping, np.ndarray) else old.damping
    points = {name: row[order] for name, row in old.points.items()}
    structure = mp.LinearStructure(old.mass[square], old.stiffness[square], damping, points)
    contacts = [replace(c, direction=old.row(c.direction)[order]) for c in scene.model.contacts]
    loads = tuple(replace(load, at=old.row(load.at)[order]) for load in scene.loads)
    model = mp.MultiPhiModel(structure, contacts, modes=scene.model.modes)
    start = {"displacement": scene.displacement[order], "velocity": scene.velocity[order]}
    return replace(scene, model=model, loads=loads, **start)


# ---------------------------------------------------------------------- in two parts


def in_two_parts(scene, motion):
    """A run that goes on where another one has ended, with all that contacts and friction keep, is the whole one."""
    model, t_end, x, v, loads = scaled(scene)
    whole, times = motion.runs[0], instants(scene)[instants(scene) > MIDDLE * scene.t_end] * (t_end / scene.t_end)
    first = mp.simulate(model, MIDDLE * t_end, x, v, loads)
    rest = mp.simulate(model, t_end, start=first, loads=loads)
    if rest.status != "ok":
        return [("failure: restart", f"{rest.status}: {rest.message}")]
    pairs = ((rest.displacement(times), whole.displacement(times)), (rest.velocity(times), whole.velocity(times)))
    scale = np.array(motion.scale) * 2.0 ** np.array([scene.units[1], scene.units[1] - scene.units[0]])
    errors = [
        np.max(np.abs(ours - theirs), axis=0) / max(np.max(np.abs(theirs)), NO_MOTION * size, 1e-300)
        for (ours, theirs), size in zip(pairs, scale, strict=True)
    ]
    if np.max(errors) <= NEAR:
        return []
    at = int(np.argmax(np.max(errors, axis=0) > NEAR)) + INSTANTS - len(times)
    return [("sensitive" if sensitive(scene, motion, at) else "failure: restart", f"off by {np.max(errors):.3g}")]


# ---------------------------------------------------------------------- in the Exudyn body


def in_the_body(scene, motion):
    """The same scene as an Exudyn object, which is alone and therefore exact at the end of every step."""
    error = _body_error(scene, motion)
    if error <= NEAR:
        return []
    return [("sensitive" if _sensitive_to_steps(scene, motion) else "failure: body", f"error {error:.3g}")]


def _body_error(scene, motion):
    run, points = motion.runs[0], list(scene.model.structure.points)
    start = (scene.model, scene.displacement, scene.t_end, BODY_STEPS, points)
    histories, _ = solve_body_alone(*start, velocity=scene.velocity, loads=scene.loads, matched=True)
    times = np.minimum(histories.time, run.t_end)
    expected = np.array([run.at(point, times) for point in points])
    found = np.array([histories.points[point] for point in points])
    size = max(np.max(np.abs(expected)), NO_MOTION * motion.scale[0], 1e-300)
    return float(np.max(np.abs(found - expected)) / size)


def _sensitive_to_steps(scene, motion):
    """Whether a nudge as large as what Exudyn's iterations leave changes the answer by as much."""
    other = native(nudged(scene, 1 + BODY_NUDGE))
    return bool(np.max(_errors(scene, other, motion), initial=0.0) > NEAR)
