"""What an event of friction and a sampled load cost, beside a contact event and a run without load.

The paper's cantilever strikes its compliant support, is pushed there by samples at 1 kHz, or rubs on a belt, with stick
phases about 2.3 times as long as those of the contact, or shorter ones. All cases alternate in one process; CPU time,
median. Ratios hold on a busy machine too.

Run: python examples/event_cost.py
"""

from __future__ import annotations

import statistics
import time
import warnings
from dataclasses import dataclass

import numpy as np

import multiphi_exudyn as mp
from multiphi_exudyn.mechanics.loads import Load
from reference_models.rig import initial_displacement, rig_beam, rig_contact, rig_damping

ROUNDS, STIFFNESS = 9, 1e6  # times that every case is timed, N/m
CONTACT, SAMPLES, BELT, SHORT_BELT = "contact", "samples at 1 kHz", "belt", "belt, short phases"
BELTS = {  # by the number of modes: point, kinetic and static limit [N], speed of the belt [m/s], time [s]
    BELT: {6: ("node1", 10.0, 40.0, 0.005, 10.0), 12: ("node2", 2.0, 8.0, 0.05, 10.0)},
    SHORT_BELT: {6: ("node2", 4.0, 16.0, 0.1, 3.0), 12: ("node1", 5.0, 20.0, 0.01, 3.0)},
}


@dataclass(frozen=True)
class Case:
    """A run: model, time [s], start (n,) [m] or None, loads."""

    model: mp.MultiPhiModel
    end: float
    start: np.ndarray | None
    loads: tuple[Load, ...] = ()

    def run(self) -> mp.Trajectory:
        """The answer."""
        return mp.simulate(self.model, self.end, displacement=self.start, loads=self.loads)


@dataclass(frozen=True)
class Cost:
    """Median of a run [ms], its events, and the mean length of its segments [ms]."""

    run: float
    events: int
    segment: float

    @property
    def event(self) -> float:
        """Of an event [us], with its share of the run."""
        return 1e3 * self.run / self.events


def cases(structure: mp.LinearStructure, modes: int) -> dict[str, Case]:
    """By their names."""
    struck = mp.MultiPhiModel(structure, [rig_contact(STIFFNESS)], modes=modes)
    bent = struck.static_equilibrium({"node3": 1e-3})
    start = bent * initial_displacement() / float(structure.row("node3") @ bent)
    times = np.linspace(0.0, 1.0, 1001)
    forces = np.cumsum(np.random.default_rng(1).normal(0.0, 0.05, len(times)))
    found = {CONTACT: Case(struck, 1.0, start)}
    found[SAMPLES] = Case(struck, 1.0, start, (mp.SampledLoad("node3", times, forces),))
    for name, given in BELTS.items():
        point, limit, static, speed, end = given[modes]
        belt = mp.Friction("belt", point, limit, static_limit=static, velocity=speed)
        found[name] = Case(mp.MultiPhiModel(structure, [belt], modes=modes), end, None)
    return found


def timed(case: Case) -> float:
    """CPU time [ms]."""
    begun = time.process_time()
    case.run()
    return 1e3 * (time.process_time() - begun)


def main(rounds: int = ROUNDS) -> dict[tuple[int, str], Cost]:
    """Costs by the number of modes and the case."""
    structure, costs = mp.planar_beam(rig_beam(), elements=57, damping=rig_damping()), {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mp.MultiPhiWarning)
        given = {(modes, name): case for modes in (6, 12) for name, case in cases(structure, modes).items()}
        answers = {key: case.run() for key, case in given.items()}
        times = [{key: timed(case) for key, case in given.items()} for _ in range(rounds)]
    for (modes, name), answer in answers.items():
        median = statistics.median(row[modes, name] for row in times)
        cost = Cost(median, len(answer.events), 1e3 * answer.t_end / len(answer.segments))
        costs[modes, name] = cost
        contact = costs[modes, CONTACT]
        told = f"{cost.run / contact.run:.2f} times the run without load"
        if name != SAMPLES:
            told = f"an event {cost.event:.2f} us, {cost.event / contact.event:.2f} times a contact's"
        print(f"{modes:2d} modes, {name:18s} {cost.run:7.3f} ms, segments of {cost.segment:5.2f} ms, {told}")
    return costs


if __name__ == "__main__":
    main()
