"""What a run costs around its loop: a short run, its warnings, its ledger, and the memory of its events.

The paper's rig with a compliant support, free, under a harmonic load and under samples at 1 kHz. All cases alternate in
one process; CPU time, median. Ratios hold on a busy machine too.

Run: python examples/run_cost.py
"""

from __future__ import annotations

import statistics
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import multiphi_exudyn as mp
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.time.simulate import Run
from reference_models.rig import initial_displacement, rig_beam, rig_contact, rig_damping

SHORT, LONG, ROUNDS = 1e-3, 1.0, 9  # s, s, times that every case is timed
STIFFNESS = 1e6  # N/m
TIMES = np.linspace(0.0, LONG, 1001)
LOADS: dict[str, tuple[Load, ...]] = {
    "free": (),
    "harmonic": (mp.HarmonicLoad("node3", 0.5, 30.0),),
    "samples": (mp.SampledLoad("node3", TIMES, np.cumsum(np.random.default_rng(1).normal(0.0, 0.05, len(TIMES)))),),
}


@dataclass(frozen=True)
class Cost:
    """Medians [ms]: of a short run, of a long one with its warnings and without, of its ledger; bytes of an event."""

    short: float
    run: float
    bare: float
    ledger: float
    event_bytes: float


def rig(modes: int) -> tuple[mp.MultiPhiModel, np.ndarray]:
    """The model, and the start (n,) [m]: bent by a force at the tip."""
    structure = mp.planar_beam(rig_beam(), elements=57, damping=rig_damping())
    model = mp.MultiPhiModel(structure, [rig_contact(STIFFNESS)], modes=modes)
    bent = model.static_equilibrium({"node3": 1e-3})
    return model, bent * initial_displacement() / float(structure.row("node3") @ bent)


def timed(asked: Callable[[], object]) -> float:
    """CPU time [ms]."""
    begun = time.process_time()
    asked()
    return 1e3 * (time.process_time() - begun)


def cost(model: mp.MultiPhiModel, start: np.ndarray, loads: tuple[Load, ...], rounds: int) -> Cost:
    """Of runs whose levels are built."""
    found = mp.simulate(model, LONG, displacement=start, loads=loads)
    rows = []
    for _ in range(rounds + 1):
        short = timed(lambda: mp.simulate(model, SHORT, displacement=start, loads=loads))
        bare = timed(lambda: Run(model, LONG, start, None, loads).trajectory())
        run = timed(lambda: mp.simulate(model, LONG, displacement=start, loads=loads))
        asked = mp.simulate(model, LONG, displacement=start, loads=loads)
        rows.append((short, run, bare, timed(lambda asked=asked: asked.ledger)))
    medians = [statistics.median(column) for column in zip(*rows[1:], strict=True)]
    return Cost(*medians, found.stats.record_bytes / len(found.events))


def main(rounds: int = ROUNDS) -> dict[str, Cost]:
    """Costs by the number of modes and the load."""
    costs = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mp.MultiPhiWarning)
        for modes in (6, 12):
            model, start = rig(modes)
            for name, loads in LOADS.items():
                costs[f"{modes} modes, {name}"] = cost(model, start, loads, rounds)
    for name, c in costs.items():
        print(
            f"{name:20s} {SHORT:g} s {c.short:6.3f} ms, {LONG:g} s {c.run:7.3f} ms, of which warnings "
            f"{100 * (1 - c.bare / c.run):3.0f} %; ledger {100 * c.ledger / c.run:4.0f} % of it; "
            f"{c.event_bytes:.0f} bytes an event"
        )
    return costs


if __name__ == "__main__":
    main()
