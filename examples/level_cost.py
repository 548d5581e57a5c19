"""What a new level costs, one contact away from the open one: all that its first event needs.

A cantilever of 200 degrees of freedom over stops, all of its modes in the base, 12 in a level. Of every level the modes
are found first, whatever the loads are; then its static response, its motion, gaps and guards, the map to it and the
map back. CPU time of this thread up to each of these, median of many new levels; code and base are warm. Threads of
BLAS that have built the base spin for a while after it, and are not counted.

Run: python examples/level_cost.py
"""

from __future__ import annotations

import itertools
import math
import time

import numpy as np

import multiphi_exudyn as mp
from multiphi_exudyn.time.loaded_levels import LoadedLevels

LENGTH, ELEMENTS, STOPS, GAP = 1.0, 100, 12, 1e-3  # m, , , m
MODES, ROUNDS = 12, 20
STIFFNESSES = {"compliant": 1e6, "rigid": math.inf}  # N/m
DAMPINGS = {"Rayleigh damping": mp.RayleighDamping(0.5, 1e-6), "modal damping": mp.ModalDamping(0.01)}
STEPS = ("modes", "level", "map", "map back")


def cantilever(stiffness: float, damping: mp.RayleighDamping | mp.ModalDamping) -> mp.MultiPhiModel:
    """The beam over stops in its outer half, its base built."""
    steel = mp.Section.rectangle(0.0, LENGTH, width=0.03, height=0.01, youngs_modulus=2.1e11, density=7850.0)
    places = {f"p{i}": LENGTH * (ELEMENTS - 4 * i) / ELEMENTS for i in range(STOPS)}
    beam = mp.planar_beam(mp.Beam([steel], places), ELEMENTS, damping)
    contacts = [mp.UnilateralContact(f"stop {i}", f"p{i}", GAP, stiffness) for i in range(STOPS)]
    model = mp.MultiPhiModel(beam, contacts, modes=MODES)
    assert model.base.modes.count == 2 * ELEMENTS, "all modes are in the base"
    return model


def costs(model: mp.MultiPhiModel) -> list[list[float]]:
    """CPU times [ms] of every level one contact away from the open one, up to the end of each of the ``STEPS``."""
    levels, rows = LoadedLevels.static(model, np.zeros(model.base.modes.count)).in_core, list[list[float]]()
    open_level = levels.level([0] * len(model.contacts))
    for i in range(len(model.contacts)):
        times = [time.thread_time()]
        model.modal_levels.level([i])
        times.append(time.thread_time())
        new = levels.level([int(k == i) for k in range(len(model.contacts))])
        times.append(time.thread_time())
        for source, target in ((open_level, new), (new, open_level)):
            levels.transition(source, target)
            times.append(time.thread_time())
        rows.append([1e3 * (end - times[0]) for end in times[1:]])
    return rows


def main(rounds: int = ROUNDS) -> dict[str, list[float]]:
    """Medians [ms] up to each of the ``STEPS`` by contact and damping, printed with lowest tenths; cases alternate."""
    cases = {
        f"{contact}, {damping}": (STIFFNESSES[contact], DAMPINGS[damping])
        for contact, damping in itertools.product(STIFFNESSES, DAMPINGS)
    }
    rows: dict[str, list[list[float]]] = {name: [] for name in cases}
    for number in range(rounds + 1):
        for name, case in cases.items():
            new = costs(cantilever(*case))
            rows[name] += new[1:] if number else []  # the first one warms the base, the first round all code
    medians = {name: np.median(given, axis=0).tolist() for name, given in rows.items()}
    for name, found in medians.items():
        lowest = np.percentile(rows[name], 10, axis=0).tolist()
        shown = (f"{step} {value:.2f} ({low:.2f})" for step, value, low in zip(STEPS, found, lowest, strict=True))
        print(f"{name:27s} up to {', '.join(shown)} ms")
    return medians


if __name__ == "__main__":
    main()
