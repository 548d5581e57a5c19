"""Are warnings of truncation right? ``python tests/campaign/truncation_study.py --count 2000 --out FILE``.

Random truncated models, each from its number alone: chains, dense matrices and beams with one to three contacts,
compliant ones from 0.1 to 1000 times as stiff as the structure there, rigid ones, or both; released from a static
deflection, struck, or loaded at once. Each is judged by the same with all modes, up to the motion's horizon:

    error = max( |y - y_all| up to the horizon / |y_all| of the run, largest error of a compliant contact's peak )

A contact that is only grazed, its spring taking less than GRAZED of the largest energy, has no peak to be judged by.
A run is warned where it has a warning of truncation. The table says how often it is silent though wrong by over WRONG,
and warned though right within RIGHT.
"""

import argparse
import json
import math
import sys
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # a plain checkout

import numpy as np
import scipy.linalg

import multiphi_exudyn as mp
from multiphi_exudyn.study.sweep import TimeLimitExceeded, call_within
from multiphi_exudyn.time.truncation import truncation_indicator

WRONG, RIGHT = 0.05, 0.005
INSTANTS = 601  # at which displacements are compared; ten times as many for forces
GRAZED = 1e-3  # of the largest energy of the run
TOLERANCE = 1e-3  # of the horizon
KINDS = ("truncated contact", "lost energy", "truncation")
LONGEST = 60.0  # s: a stop without a gap may be struck a hundred thousand times
SIZE = 1e-2  # m, of the motion at the points


@dataclass(frozen=True)
class Case:
    """model: with all modes. modes: of the truncated one. start: arguments of simulate."""

    model: mp.MultiPhiModel
    modes: int
    t_end: float
    start: dict
    kind: str
    law: str


def case(number):
    """The case of a number."""
    random = np.random.default_rng(number)
    kind, law = ("chain", "dense", "beam")[number % 3], ("compliant", "rigid", "mixed")[number // 3 % 3]
    mass, stiffness, rows = {"chain": _chain, "dense": _dense, "beam": _beam}[kind](random)
    n = len(mass)
    squares, shapes = scipy.linalg.eigh(stiffness, mass)
    omega = np.sqrt(np.where(squares > 1e-12 * squares[-1], squares, 0.0))
    elastic = omega[omega > 0]
    damping = (None, _stiffness_damping(elastic, random), mp.ModalDamping(float(10 ** random.uniform(-3, -1.5))))
    points = {f"p{i}": row for i, row in enumerate(rows)}
    structure = mp.LinearStructure(mass, stiffness, damping[random.integers(3)], points)
    released = ("static", "struck", "loaded")[random.integers(3)] if len(elastic) == n else "struck"
    shape, start = _motion(released, stiffness, omega, shapes, rows, random)
    places = random.choice(len(rows), min(int(random.choice([1, 1, 2, 3])), len(rows)), replace=False)
    flexible = (shapes[:, omega > 0] / elastic) @ (shapes[:, omega > 0] / elastic).T
    contacts = [
        _contact(f"c{i}", rows[k], shape, flexible, law == "rigid" or (law == "mixed" and i % 2 == 1), random)
        for i, k in enumerate(places)
    ]
    fewest = n - len(elastic) + 2
    modes = round(math.exp(random.uniform(math.log(3), math.log(max(4, n - 1)))))
    periods = random.uniform(1, 6 if len(elastic) == n else 3)
    model = mp.MultiPhiModel(structure, contacts, "all")
    kept = min(max(modes, fewest), n - len(contacts))
    return Case(model, kept, float(periods * 2 * math.pi / elastic[0]), start, kind, law)


def _chain(random):
    n = int(random.integers(6, 41))
    unequal = random.random() < 0.5
    springs = 1e4 * (10.0 ** random.uniform(-0.5, 0.5, n) if unequal else np.ones(n))
    if random.random() < 0.15:
        springs[0] = 0.0
    following = np.r_[springs[1:], 0.0]
    stiffness = np.diag(springs + following) - np.diag(springs[1:], 1) - np.diag(springs[1:], -1)
    return np.diag(10.0 ** random.uniform(-0.3, 0.3, n) if unequal else np.ones(n)), stiffness, np.eye(n)


def _dense(random):
    n = int(random.integers(6, 31))
    omega = 2 * math.pi * 10.0 ** random.uniform(0, 2, n)
    root = random.normal(size=(n, n)) / math.sqrt(n)
    mass = root @ root.T + np.eye(n)
    factor = np.linalg.cholesky(mass) @ np.linalg.qr(random.normal(size=(n, n)))[0]
    stiffness = (factor * omega**2) @ factor.T
    return mass, (stiffness + stiffness.T) / 2, np.eye(n)


def _beam(random):
    elements, length = int(random.integers(6, 25)), float(random.uniform(0.3, 2))
    height, places = length * float(random.uniform(0.005, 0.03)), random.uniform(0.2, 1, 4) * length
    section = mp.Section.rectangle(
        0.0, length, width=0.03, height=height, youngs_modulus=2e11, density=7800, poisson_ratio=0.3
    )
    tip = float(random.uniform(0, 1)) * 7800 * 0.03 * height * length
    masses = [mp.PointMass(float(places[0]), tip, 0.0)] if random.random() < 0.5 else []
    structure = mp.planar_beam(mp.Beam([section], {f"p{i}": float(x) for i, x in enumerate(places)}, masses), elements)
    rows = np.array([structure.row(f"p{i}") for i in range(len(places))])
    return np.asarray(structure.mass), np.asarray(structure.stiffness), rows


def _stiffness_damping(elastic, random):
    third = elastic[min(2, len(elastic) - 1)]
    return mp.RayleighDamping(beta=2 / third * float(10 ** random.uniform(-3, -1.7)))


def _motion(released, stiffness, omega, shapes, rows, random):
    """A shape (n,) that is SIZE at the points where it is largest, and the start or load that leads through it."""
    pull = rows[random.integers(len(rows))]
    if released == "struck":
        amounts = random.normal(size=min(len(omega), 4))
        lowest = omega[omega > 0][0]
        shape = shapes[:, : len(amounts)] @ (amounts / np.maximum(omega[: len(amounts)], lowest))
        scale = SIZE / np.max(np.abs(rows @ shape))
        return scale * shape, {"velocity": scale * shapes[:, : len(amounts)] @ amounts}
    shape = np.linalg.solve(stiffness, pull)
    scale = SIZE / np.max(np.abs(rows @ shape))
    if released == "static":
        return scale * shape, {"displacement": scale * shape}
    return -scale * shape, {"loads": (mp.ConstantLoad(-pull, float(scale)),)}


def _contact(name, row, shape, flexible, rigid, random):
    """On the side that the start leaves free, its gap a part of the motion there."""
    reach = float(row @ shape)
    sign = (1.0 if reach > 0 else -1.0) if random.random() < 0.8 or rigid else -1.0
    gap = float(random.choice([0.0, random.uniform(0, 0.8)])) * abs(reach)
    stiffness = math.inf if rigid else float(10 ** random.uniform(-1, 3) / (row @ flexible @ row))
    return mp.UnilateralContact(name, sign * row, gap, stiffness)


def judged(number):
    """What came out of a case: a dictionary for a line of the file."""
    try:
        return call_within(LONGEST, lambda: _judged(number))
    except TimeLimitExceeded:
        return {"number": number, "status": "not finished"}


def _judged(number):
    given = case(number)
    told = {"number": number, "kind": given.kind, "law": given.law, "n": given.model.structure.n, "r": given.modes}
    full = mp.simulate(given.model, given.t_end, **given.start)
    found = mp.simulate(replace(given.model, modes=given.modes), given.t_end, **given.start)
    if (full.status, found.status) != ("ok", "ok") or not full.events:
        return told | {"status": "no contact" if full.status == "ok" == found.status else "failed"}
    end = full.horizon(TOLERANCE)
    kinds = [sentence.split(":")[0] for sentence in found.warnings]
    return told | {
        "status": "ok",
        "displacement": _displacement_error(full, found, end),
        "force": _force_error(full, found, end),
        "warned": [kind for kind in kinds if kind in KINDS],
        "indicator": truncation_indicator(found),
        "share": end / full.t_end,
    }


def _displacement_error(full, found, end):
    times = np.linspace(0, full.t_end, INSTANTS)
    expected, given = (full.model.base.coordinates(run.displacement(times)) for run in (full, found))
    apart = np.linalg.norm(given - expected, axis=0)[times <= end]
    whole = math.sqrt(np.mean(np.sum(expected**2, axis=0)))
    return math.sqrt(np.mean(apart**2)) / max(whole, np.finfo(float).tiny)


def _force_error(full, found, end):
    times, worst = np.linspace(0, end, 10 * INSTANTS), 0.0
    energy = float(np.max(np.abs(full.energy(times))))
    for contact in full.model.contacts:
        expected, given = (float(np.max(run.contact_force(contact.name, times))) for run in (full, found))
        if not contact.rigid and 0.5 * max(expected, given) ** 2 / contact.stiffness > GRAZED * energy:
            worst = max(worst, abs(given - expected) / max(expected, given))
    return worst


def table(lines):
    """The counts, by contact law and in all."""
    print(f"{'law':10s} cases  right  wrong | silent: and wrong | warned: and right")
    judged_ones = [line for line in lines if line["status"] == "ok"]
    for law in ("compliant", "rigid", "mixed", "all"):
        chosen = [line for line in judged_ones if law in (line["law"], "all")]
        errors = np.array([max(line["displacement"], line["force"]) for line in chosen])
        warned = np.array([bool(line["warned"]) for line in chosen], bool)
        wrong, right = errors > WRONG, errors < RIGHT
        print(
            f"{law:10s} {len(chosen):5d}  {np.sum(right):5d}  {np.sum(wrong):5d} |  {np.sum(~warned):5d}: "
            f"{np.sum(~warned & wrong):9d} |  {np.sum(warned):5d}: {np.sum(warned & right):9d}"
        )
    unjudged = sum(line["status"] in ("failed", "not finished") for line in lines)
    print(f"of {len(lines)}: {len(judged_ones)} judged, {unjudged} failed or took long")


def main(arguments=None):
    """Runs the cases that the file does not hold, and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--out", type=Path, default=Path("truncation-study.jsonl"), help="one line for every case")
    given = parser.parse_args(arguments)
    warnings.simplefilter("ignore", mp.MultiPhiWarning)
    with given.out.open("w", encoding="utf-8") as file:
        for number in range(given.first, given.first + given.count):
            print(json.dumps(judged(number)), file=file, flush=True)
    table([json.loads(line) for line in given.out.read_text("utf-8").splitlines()])


if __name__ == "__main__":
    main()
