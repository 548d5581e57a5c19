"""The paper's cantilever in Exudyn's renderer: at the start, pulled up, and later, pressed on its support.

Run: python examples/draw_body.py   writes body_in_exudyn.png into the present directory; no display is needed
"""

from __future__ import annotations

from pathlib import Path

import exudyn as exu
import numpy as np
from matplotlib.image import imsave

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, Drawing
from reference_models.rig import initial_displacement, rig_beam, rig_contact, rig_damping
from reference_models.solver_settings import fixed_steps

STEP, END = 5e-4, 0.088  # s; at the end the contact is closed
SCALE, RADIUS = 4.0, 3e-3  # deflections are shown four times as large; m
WINDOW = [1000, 300]  # pixels of one picture


def redrawn(system: exu.SystemContainer) -> np.ndarray:
    """Image (height, width, 3) of the present state, by the ray tracer."""
    return np.array(system.renderer.RedrawAndGetImage(useRaytracer=True))


def main() -> np.ndarray:
    """Both pictures, the later one below; also written to body_in_exudyn.png."""
    structure = mp.planar_beam(rig_beam(), elements=57, damping=rig_damping())
    model = mp.MultiPhiModel(structure, [rig_contact(1e6)], modes=6)
    pulled = model.static_equilibrium({"node3": 1.0})
    pulled = pulled * initial_displacement() / (structure.row("node3") @ pulled)

    system = exu.SystemContainer()
    mbs = system.AddSystem()
    drawing = Drawing.of_beam(rig_beam(), elements=57, scale=SCALE, radius=RADIUS)
    CreateMultiPhiBody(mbs, model, name="beam", displacement=pulled, matchedStepSize=STEP, drawing=drawing)
    mbs.Assemble()
    system.visualizationSettings.view0.window.renderWindowSize = WINDOW
    system.renderer.ZoomAll()
    start = redrawn(system)
    mbs.SolveDynamic(fixed_steps(END, round(END / STEP)), solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    mbs.systemData.SetSystemState(
        mbs.systemData.GetSystemState(exu.ConfigurationType.Current), exu.ConfigurationType.Visualization
    )
    both = np.vstack((start, redrawn(system)))
    imsave(Path("body_in_exudyn.png"), both)
    return both


if __name__ == "__main__":
    main()
