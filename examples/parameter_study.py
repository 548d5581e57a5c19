"""Your own study: any function of one parameter dict, over a grid, on all cores; killed at any moment, it goes on.

Run: python examples/parameter_study.py [FILE]    (the finished runs are kept in FILE, parameter_study.sqlite if none)
The same for models of a scene needs no code: multiphi-exudyn study pareto
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Mapping
from typing import Any

import multiphi_exudyn as mp
from multiphi_exudyn.study.sweep import Row, Store, grid, open_executor, sweep
from reference_models.rig import rig_beam, rig_contact, rig_damping

AXES = {
    "stiffness": [1e4, 1e5, 1e6, 1e7],  # N/m, of the support
    "displacement": [0.005, 0.01, 0.02, 0.04],  # m, of the tip, to which it is pulled
}


@functools.cache
def structure() -> mp.LinearStructure:
    """The paper's rig; built once in every process."""
    return mp.planar_beam(rig_beam(), elements=40, damping=rig_damping())


def run(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Release the tip and look at half a second; what is returned becomes a row."""
    model = mp.MultiPhiModel(structure(), [rig_contact(parameters["stiffness"])], modes=mp.Tolerance(0.01))
    pulled = model.static_equilibrium({"node3": 1.0})
    start = pulled * parameters["displacement"] / float(structure().row("node3") @ pulled)
    trajectory = mp.simulate(model, t_end=0.5, displacement=start)
    closed = trajectory.contact_intervals("support")
    return {
        "modes": trajectory.model.level(()).modes,
        "contacts": len(closed),
        "first contact [ms]": 1e3 * closed[0][0] if closed else None,
        "time closed [ms]": 1e3 * sum(end - begin for begin, end in closed),
        "impulse [N s]": trajectory.contact_impulse("support", 0.0, 0.5),
        "energy left": trajectory.ledger.final / trajectory.ledger.initial,
    }


def main(path: str = "parameter_study.sqlite", where: str = "processes") -> tuple[Row, ...]:
    """Run what FILE does not have yet, and print the table."""
    with Store(path) as store, open_executor(where) as executor:
        rows = sweep(run, grid(AXES), store, "release", executor=executor, budget_s=60.0)
    for row in rows:
        told = row.message or "  ".join(
            f"{name} {value:.4g}" for name, value in row.values.items() if value is not None
        )
        print(f"{row.parameters['stiffness']:8.0e} N/m  {1e3 * row.parameters['displacement']:3.0f} mm  {told}")
    return rows


if __name__ == "__main__":
    main(*sys.argv[1:2])
