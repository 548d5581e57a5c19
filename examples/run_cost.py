"""What a run costs around its loop: a short run, its warnings, its ledger, and the memory of its events.

The paper's rig with a compliant support, free, under a harmonic load and under samples at 1 kHz. What warnings cost is
a run with them against one of a model that nobody asks for any: its loop does not look at the size of the motion. CPU
time, lowest tenth, as whatever disturbs a run makes it longer. Runs of a kind follow each other in a row before the
next kind has its turn; of the ledger it is told as well what it takes where one of each kind follows the other, and
its Python is cold. Ratios hold on a busy machine too.

Run: python examples/run_cost.py
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

import multiphi_exudyn as mp
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.time.simulate import Run, checked_end, holding
from reference_models.rig import initial_displacement, rig_beam, rig_contact, rig_damping

SHORT, LONG, ROUNDS = 1e-3, 1.0, 40  # s, s, turns of every kind
RUNS, UNSEEN = 10, 2  # in a row, and before them, not timed
TENTH = 10  # % of all times
STIFFNESS = 1e6  # N/m
TIMES = np.linspace(0.0, LONG, 1001)
LOADS: dict[str, tuple[Load, ...]] = {
    "free": (),
    "harmonic": (mp.HarmonicLoad("node3", 0.5, 30.0),),
    "samples": (mp.SampledLoad("node3", TIMES, np.cumsum(np.random.default_rng(1).normal(0.0, 0.05, len(TIMES)))),),
}


@dataclass(frozen=True)
class Cost:
    """CPU times [ms]: of a short run, of a long one with its warnings and without any, of its ledger."""

    short: float
    run: float
    bare: float
    ledger: float

    @property
    def shares(self) -> tuple[float, float]:
        """Of the long run that are its warnings, and that its ledger takes [%]."""
        return 100 * (1 - self.bare / self.run), 100 * self.ledger / self.run


def rig(modes: int) -> tuple[mp.MultiPhiModel, np.ndarray]:
    """The model, and the start (n,) [m]: bent by a force at the tip."""
    structure = mp.planar_beam(rig_beam(), elements=57, damping=rig_damping())
    model = mp.MultiPhiModel(structure, [rig_contact(STIFFNESS)], modes=modes)
    bent = model.static_equilibrium({"node3": 1e-3})
    return model, bent * initial_displacement() / float(structure.row("node3") @ bent)


def timed(asked: Callable[[], object]) -> float:
    """CPU time [ms]."""
    begun = time.process_time_ns()
    asked()
    return 1e-6 * (time.process_time_ns() - begun)


def kinds(modes: int, loads: tuple[Load, ...]) -> dict[str, Callable[[], float]]:
    """CPU times [ms] of each kind, in models of their own whose levels are built; by the fields of Cost."""
    (asked, start), (unasked, _) = rig(modes), rig(modes)

    def run(end: float) -> mp.Trajectory:
        return mp.simulate(asked, end, displacement=start, loads=loads)

    def bare() -> mp.Trajectory:
        return Run(holding(unasked, loads), checked_end(unasked, LONG), start, None, loads).trajectory()

    def ledger() -> float:
        found = run(LONG)
        return timed(lambda: found.ledger)

    return {
        "short": lambda: timed(lambda: run(SHORT)),
        "run": lambda: timed(lambda: run(LONG)),
        "bare": lambda: timed(bare),
        "ledger": ledger,
    }


def cost(kinds: Mapping[str, Callable[[], float]], rounds: int, runs: int) -> Cost:
    """The last ``runs`` of each kind in a row, in so many rounds."""
    times: dict[str, list[float]] = {name: [] for name in kinds}
    for _ in range(rounds):
        for name, taken in kinds.items():
            times[name] += [taken() for _ in range(runs if runs == 1 else runs + UNSEEN)][-runs:]
    return Cost(**{name: float(np.percentile(found, TENTH)) for name, found in times.items()})


def event_bytes(modes: int, loads: tuple[Load, ...]) -> float:
    """Of the record of a run."""
    model, start = rig(modes)
    found = mp.simulate(model, LONG, displacement=start, loads=loads)
    return found.stats.record_bytes / len(found.events)


def main(rounds: int = ROUNDS) -> dict[str, tuple[Cost, Cost, float]]:
    """Costs in a row and in turn, and bytes of an event, by the number of modes and the load."""
    costs = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mp.MultiPhiWarning)
        for modes in (6, 12):
            for name, loads in LOADS.items():
                taken = kinds(modes, loads)
                cost(taken, 2, 1)  # levels are built, and what sizes and ledgers are read from is packed
                found = cost(taken, rounds, RUNS), cost(taken, rounds, 1), event_bytes(modes, loads)
                costs[f"{modes} modes, {name}"] = found
    for name, (row, turn, memory) in costs.items():
        (told, ledger), (_, cold) = row.shares, turn.shares
        print(
            f"{name:20s} {SHORT:g} s {row.short:6.3f} ms, {LONG:g} s {row.run:7.3f} ms, of which warnings "
            f"{told:4.1f} %; ledger {ledger:4.1f} % of it, {cold:4.1f} % in turn; "
            f"{memory:.0f} bytes an event"
        )
    return costs


if __name__ == "__main__":
    main()
