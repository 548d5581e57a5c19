"""Friction on the full beam, Exudyn's own connector, against all modes of its linearisation, at small displacements."""

import dataclasses

import numpy as np
import pytest

import multiphi_exudyn as mp
from multiphi_exudyn.mathematics.modes import complete_modes
from multiphi_exudyn.mechanics.beam import Beam, Section
from reference_models.full_beam import FullBeam, FullBeamSettings

BEAM = Beam(
    [Section.rectangle(0, 0.5, width=0.06, height=3.5e-3, youngs_modulus=43.5e9, density=2700.0)],
    points={"middle": 0.3, "tip": 0.5},
)
SETTINGS = FullBeamSettings(elements=4, newton_tolerance=1e-6)
LOAD = mp.HarmonicLoad("tip", 0.05, 12.0, -np.pi / 2)
T_END = 0.2
RING = mp.Friction("ring", "middle", 0.02, stiffness=1e5)


def damping(structure, ratio=0.02):
    modes = complete_modes(structure.mass, structure.stiffness)
    weights = structure.mass @ modes.shapes
    return weights * (2 * ratio * modes.omega) @ weights.T


def reduced(friction, start=None, loads=(LOAD,)):
    s = FullBeam(BEAM, (), SETTINGS).structure
    structure = mp.LinearStructure(s.mass, s.stiffness, damping(s), s.points)
    return mp.simulate(mp.MultiPhiModel(structure, [friction], modes="all"), T_END, displacement=start, loads=loads)


def full(friction, step):
    beam = FullBeam(BEAM, (), dataclasses.replace(SETTINGS, step=step), frictions=[friction])
    run = beam.run(T_END, damping=damping(beam.structure), loads=[LOAD], progress=False)
    assert run.status == "ok", run.message
    return run


def difference(run, trajectory, names=("middle", "tip")):
    pairs = [(run.points[name], np.asarray(trajectory.at(name, run.time))) for name in names]
    return max(np.linalg.norm(one - other) / np.linalg.norm(other) for one, other in pairs)


@pytest.mark.parametrize(
    ("friction", "ceiling", "rate"),
    [
        (RING, 2e-3, 1.5),
        (mp.Friction("ring", {"tip": 1.0, "middle": -1.0}, 0.02, stiffness=1e5), 2e-3, 1.5),
        (dataclasses.replace(RING, direction={"middle": -2.0}, velocity=2e-3), 2e-3, 1.0),
        (dataclasses.replace(RING, static_limit=0.025), 0.05, 0.8),  # slip sets in at the end of a step
    ],
    ids=["one point", "two points", "surface that moves", "static limit"],
)
def test_the_difference_to_all_modes_falls_with_the_step(friction, ceiling, rate):
    trajectory = reduced(friction)
    assert trajectory.status == "ok"
    assert len(trajectory.events) > 4
    errors = [difference(full(friction, step), trajectory) for step in (1.6e-4, 2e-5)]
    assert errors[1] < ceiling
    assert np.log2(errors[0] / errors[1]) / 3 > rate


@pytest.fixture(scope="module", params=[0.0, 2e-3], ids=["at rest", "moving"])
def both(request):
    """A friction on a counter-surface of that velocity, and its run."""
    friction = dataclasses.replace(RING, velocity=request.param)
    return friction, full(friction, 2e-5)


class TestOutputs:
    def test_the_energy_balance_closes(self, both):
        _, run = both
        balance = run.balance
        assert balance.friction > 0.3 * balance.work
        left = balance.initial + balance.work - balance.dissipated - balance.friction - balance.final
        assert abs(left) < 1e-3 * balance.work
