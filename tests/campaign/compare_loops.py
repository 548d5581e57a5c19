"""The loop on flat arrays beside the NumPy loop, over the random scenes of the campaign.

    python tests/campaign/compare_loops.py --kinds all --first 0 --count 100 [--plain]

Of every scene: same status and message, same events (times to NEAR of the run), losses and impulses, same phases and
levels of all segments, same motion; or a run whose start is nudged by NUDGE differs as much from the NumPy loop's own.
"""

import argparse
import sys
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # a plain checkout

import numpy as np
from campaign_scenes import KINDS, scaled, scene_of
from strategies import built, recipe_of

from multiphi_exudyn import MultiPhiError, MultiPhiWarning
from multiphi_exudyn.time import loop_motion
from multiphi_exudyn.time.loop import advance
from multiphi_exudyn.time.simulate import started

ALL_KINDS = ("plain", *KINDS)
NEAR = 1e-9  # of the run: times of events
CLOSE = 1e-6  # of the largest displacement, impulse and energy: what times that near make of them
NUDGES = (1e-12, -1e-12, 3e-12)  # of the start, or where that is zero of the speeds of the run
INSTANTS = 40
LOSSES = ("impact", "truncation_kinetic", "truncation_strain", "stop_work", "damping")


def arguments_of(kind, number):
    """(model, t_end, displacement, velocity, loads)."""
    if kind == "plain":
        case = built(recipe_of(number))
        return case.model, case.t_end, case.displacement, case.velocity, case.loads
    return scaled(scene_of(kind, number))


def verdict(kind, number):
    """ "same", "sensitive", "refused", or in what the loops differ."""
    try:
        model, end, x, v, loads = arguments_of(kind, number)
        first, second = (_run(model, end, x, v, loads, compiled) for compiled in (False, None))
    except MultiPhiError:
        return "refused"
    found = differences(first, second)
    if not found:
        return "same"
    speed = np.max(np.abs(first.velocity(_instants(first)))) if first.segments else 0.0
    for share in NUDGES:
        nudged = (1 + share) * x, (1 + share) * v
        if not (np.any(x) or np.any(v)):
            nudged = x, share * speed * (-1.0) ** np.arange(len(v))
        if differences(first, _run(model, end, *nudged, loads, False)):
            return "sensitive"
    return "; ".join(found)


def differences(first, second):
    """In what two runs differ."""
    found = []
    if (first.status, first.message) != (second.status, second.message):
        found.append(f"{first.status} {first.message!r} / {second.status} {second.message!r}")
    for name in ("events", "segments"):
        counts = [len(getattr(run, name)) for run in (first, second)]
        if counts[0] != counts[1]:
            found.append(f"{name}: {counts[0]} / {counts[1]}")
    found += _different_events(first, second)
    if first.segments and second.segments:
        standing = [[(s.level.level.indices, s.phases) for s in run.segments] for run in (first, second)]
        apart = [k for k, (one, other) in enumerate(zip(*standing, strict=False)) if one != other]
        found += [f"phases from segment {k}" for k in apart[:1]]
        t = np.linspace(0, min(first.t_end, second.t_end), INSTANTS)
        one, other = (run.displacement(t) for run in (first, second))
        if not np.max(np.abs(one - other)) <= CLOSE * np.max(np.abs(one)):
            found.append("motion")
    return found


def _different_events(first, second):
    """The first event in which two runs differ, told."""
    losses = [abs(getattr(e.loss, name)) for e in first.events for name in LOSSES]
    energies = np.abs(first.energy(_instants(first))) if first.segments else np.zeros(1)
    energy = float(np.max(energies)) + max(losses, default=0.0)
    impulse = max((e.impulse for e in first.events), default=0.0)
    for k, (e, f) in enumerate(zip(first.events, second.events, strict=False)):
        if (e.contact, e.kind) != (f.contact, f.kind) or not abs(e.time - f.time) <= NEAR * first.t_end:
            return [f"event {k}: {e.time:.15g} {e.contact} {e.kind} / {f.time:.15g} {f.contact} {f.kind}"]
        if not all(abs(getattr(e.loss, name) - getattr(f.loss, name)) <= CLOSE * energy for name in LOSSES):
            return [f"event {k}: {e.loss} / {f.loss}"]
        pushed = [dict(event.shared) | {"": event.impulse} for event in (e, f)]
        names = set(pushed[0]) | set(pushed[1])
        if not all(abs(pushed[0].get(n, 0.0) - pushed[1].get(n, 0.0)) <= CLOSE * impulse for n in names):
            return [f"event {k}: impulses {pushed[0]} / {pushed[1]}"]
    return []


def _instants(run):
    return np.linspace(0, run.t_end, INSTANTS)


def _run(model, end, x, v, loads, compiled):
    motion = started(model, end, x, v, loads, compiled)
    motion.advance(end)
    return motion.trajectory(end)


def main(given=None):
    """Exit code 0 where the loops agree."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kinds", default="all")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--plain", action="store_true", help="the loop as plain Python")
    options = parser.parse_args(given)
    if options.plain:
        loop_motion.carry = advance
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", MultiPhiWarning)
    failures = 0
    for kind in ALL_KINDS if options.kinds == "all" else options.kinds.split(","):
        counts = {"same": 0, "sensitive": 0, "refused": 0}
        for number in range(options.first, options.first + options.count):
            told = verdict(kind, number)
            if told in counts:
                counts[told] += 1
            else:
                failures += 1
                print(f"{kind} {number}: {told[:400]}", flush=True)
        print(f"{kind}: {counts}", flush=True)
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main())
