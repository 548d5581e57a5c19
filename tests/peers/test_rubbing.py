"""Friction that goes with the pressure of a stop, on the full beams of a rod's two planes."""

import dataclasses

import numpy as np
import pytest

import multiphi_exudyn as mp
from multiphi_exudyn.mathematics.modes import complete_modes
from multiphi_exudyn.mechanics.beam import Beam, Section
from reference_models.beams import Beams
from reference_models.full_beam import FullBeam, FullBeamSettings
from reference_models.point_contact import Tangent


def rod(height, width):
    """One plane of a cantilever of 0.5 m."""
    section = Section.rectangle(0, 0.5, width=width, height=height, youngs_modulus=43.5e9, density=2700.0)
    return Beam([section], points={"middle": 0.3, "tip": 0.5})


BEAMS = Beams({"up": rod(6e-3, 7e-3), "side": rod(7e-3, 6e-3)})
SETTINGS = FullBeamSettings(elements=4, newton_tolerance=1e-7)
LOADS = [mp.HarmonicLoad("up.tip", 0.02, 30.0, -np.pi / 2), mp.HarmonicLoad("side.tip", 0.01, 47.0, -np.pi / 2)]


def damping(structure, ratio=0.02):
    modes = complete_modes(structure.mass, structure.stiffness)
    weights = structure.mass @ modes.shapes
    return weights * (2 * ratio * modes.omega) @ weights.T


def full(step, contacts=(), tangent=None, frictions=(), t_end=0.1):
    beam = FullBeam(BEAMS, contacts, dataclasses.replace(SETTINGS, step=step), frictions=frictions)
    beam.contacts = tuple(dataclasses.replace(contact, tangent=tangent) for contact in beam.contacts)
    run = beam.run(t_end, damping=damping(beam.structure), loads=LOADS, progress=False)
    assert run.status == "ok", run.message
    return run


@pytest.mark.parametrize("share", [1.0, 1.3])
def test_under_a_constant_pressure_it_is_exudyns_friction_connector(share):
    """A very soft stop, far inside which the beam is, presses with 0.01 N whatever the beam does."""
    soft = mp.UnilateralContact("stop", "up.middle", gap=-1e4, stiffness=1e-6)
    tangent = Tangent("side.middle", -2.0, friction=0.4, static_friction=0.4 * share, stiffness=2e4)
    ring = mp.Friction("ring", {"side.middle": -2.0}, 4e-3, 4e-3 * share, stiffness=2e4)
    rubbed, given = full(2e-5, [soft], tangent), full(2e-5, [soft], frictions=[ring])
    assert np.max(np.abs(rubbed.friction_force["stop"])) == pytest.approx(4e-3 * share, rel=0.01)
    for name in ("side.middle", "side.tip"):
        difference = np.linalg.norm(rubbed.points[name] - given.points[name])
        assert difference < (2e-3 if share == 1 else 2e-2) * np.linalg.norm(given.points[name])
