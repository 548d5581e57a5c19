"""The paper's cantilever as a body in an Exudyn system, step by step beside the same model on its own.

Run: python examples/inside_exudyn.py
"""

from __future__ import annotations

import exudyn as exu
import numpy as np

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import BodyHistories, CreateMultiPhiBody, body_histories
from reference_models.rig import initial_displacement, rig_beam, rig_contact, rig_damping

STEP, END, STIFFNESS = 5e-4, 1.0, 1e6  # s, s, N/m


def settings() -> exu.SimulationSettings:
    """A fixed step, nothing printed, nothing written."""
    chosen = exu.SimulationSettings()
    chosen.timeIntegration.numberOfSteps = round(END / STEP)
    chosen.timeIntegration.endTime = END
    chosen.timeIntegration.verboseMode = 0
    chosen.solution.file.write = False
    chosen.solution.sensors.writePeriod = 1e-3
    return chosen


def main() -> tuple[BodyHistories, float]:
    """Histories of the body, and its largest distance [m] from ``simulate`` at the tip."""
    structure = mp.planar_beam(rig_beam(), elements=57, damping=rig_damping())
    model = mp.MultiPhiModel(structure, [rig_contact(STIFFNESS)], modes=6)
    pulled = model.static_equilibrium({"node3": 1.0})
    pulled = pulled * initial_displacement() / (structure.row("node3") @ pulled)

    system = exu.SystemContainer()
    mbs = system.AddSystem()
    items = CreateMultiPhiBody(mbs, model, name="beam", displacement=pulled, matchedStepSize=STEP)
    mbs.Assemble()  # bodies, loads and connectors of your own would be added before this line
    mbs.SolveDynamic(settings(), solverType=exu.DynamicSolverType.TrapezoidalIndex2)

    body = body_histories(mbs, items)
    alone = mp.simulate(model, END, displacement=pulled)
    distance = float(np.max(np.abs(body.points["node3"] - alone.at("node3", np.minimum(body.time, END)))))
    print(f"{len(body.events)} events in {END:g} s, {round(END / STEP)} steps, first contact at "
          f"{body.contact_intervals['support'][0][0] * 1e3:.4f} ms")  # fmt: skip
    print(f"largest contact force {np.max(body.contact_force['support']):.1f} N at the samples")
    print(f"largest distance from the model on its own: {distance:.1e} m")
    return body, distance


if __name__ == "__main__":
    main()
