"""The full beam and all modes of its own linearisation agree where geometry is linear: only the time step is left."""

import dataclasses

import numpy as np

import multiphi_exudyn as mp
from multiphi_exudyn.mathematics.modes import complete_modes
from reference_models.full_beam import FullBeam, FullBeamSettings
from reference_models.rig import rig_beam, rig_damping

SMALL = 0.05  # of the rig's displacements and gap: 1 mm at the tip
CONTACT = mp.UnilateralContact("support", "node2", SMALL * 1.35e-3, 1e5)


def reduced(beam, t_end):
    """All modes of the beam's linearisation, and the damping matrix that both models carry."""
    s, modes = beam.structure, complete_modes(beam.structure.mass, beam.structure.stiffness)
    weights = s.mass @ modes.shapes
    damping = weights * (2 * rig_damping().of(modes.count) * modes.omega) @ weights.T
    structure = mp.LinearStructure(s.mass, s.stiffness, damping, s.points)
    model = mp.MultiPhiModel(structure, [CONTACT], modes="all")
    unit = model.static_equilibrium({"node3": 1e-6})
    start = unit * SMALL * 0.02 / float(structure.row("node3") @ unit)
    return mp.simulate(model, t_end, displacement=start), damping


def differences(steps, t_end, elements=8):
    """Worst NRMSE of node2 and node3 between the full beam at each step and the reduced model."""
    settings = FullBeamSettings(elements=elements, newton_tolerance=1e-6)
    trajectory, damping = reduced(FullBeam(rig_beam(), [CONTACT], settings), t_end)
    errors = []
    for step in steps:
        beam = FullBeam(rig_beam(), [CONTACT], dataclasses.replace(settings, step=step))
        start = {"load_at": "node3", "measured_at": "node3", "displacement": SMALL * 0.02}
        run = beam.run(t_end, **start, damping=damping, progress=False)
        assert run.status == "ok", run.message
        pairs = [(run.points[name], np.asarray(trajectory.at(name, run.time))) for name in ("node2", "node3")]
        errors.append(max(np.linalg.norm(full - own) / np.linalg.norm(full) for full, own in pairs))
    return errors


def test_the_difference_falls_with_the_square_of_the_full_models_step():
    errors = differences((8e-5, 4e-5, 2e-5), t_end=0.3)
    assert errors[-1] < 1e-4
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 1.7)
