"""A body that only its contacts hold rests on them where they can carry its load, and nowhere else."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import nnls

import multiphi_exudyn as mp

STIFF = pytest.mark.parametrize("stiffness", [1e5, math.inf])


def mass(contacts, **changes):
    structure = mp.LinearStructure(np.eye(1), np.zeros((1, 1)), points={"z": 0})
    return mp.MultiPhiModel(structure, contacts, **changes)


def bar(contacts):
    """A rigid bar of two masses of 1 kg, 1 m apart: both move up and down; "mid" is halfway between them."""
    points = {"left": 0, "right": 1, "mid": np.array([0.5, 0.5])}
    return mp.MultiPhiModel(mp.LinearStructure(np.eye(2), np.zeros((2, 2)), points=points), contacts)


class TestRests:
    @STIFF
    def test_a_mass_on_a_floor(self, stiffness):
        model = mass([mp.UnilateralContact("floor", "z", 0.01, stiffness)])
        assert_allclose(model.static_equilibrium({"z": -9.81}), [-0.01 - 9.81 / stiffness], rtol=1e-12)

    @STIFF
    def test_a_bar_on_two_supports_of_which_one_is_further(self, stiffness):
        floors = [
            mp.UnilateralContact("a", "left", 0.01, stiffness),
            mp.UnilateralContact("b", "right", 0.02, 2 * stiffness),
        ]
        x = bar(floors).static_equilibrium({"mid": -30.0})
        assert_allclose(x, [-0.01 - 15 / stiffness, -0.02 - 7.5 / stiffness], rtol=1e-12)

    def test_a_shaft_in_bearings_with_play(self):
        section = mp.Section.rectangle(0.0, 2.0, width=0.08, height=0.08, youngs_modulus=2.1e11, density=7850.0)
        points = {"A": 0.0, "B": 1.0, "C": 2.0, "F": 0.6}
        shaft = mp.planar_beam(mp.Beam([section], points, clamp=mp.Clamp(translation=0.0, rotation=0.0)), elements=40)
        play, stiffness = 5e-5, 2e8
        bearings = [
            mp.UnilateralContact(f"{name}{side:+g}", {name: side}, play, stiffness)
            for name in "ABC"
            for side in (1.0, -1.0)
        ]
        model = mp.MultiPhiModel(shaft, bearings, modes="all")
        x = model.static_equilibrium({"F": -1e4})
        assert abs(shaft.row("B") @ x + 87.8e-6) < 2e-8
        gaps = np.array([shaft.row(bearing.direction) @ x + play for bearing in bearings])
        forces = np.maximum(-gaps, 0.0) * stiffness
        carried = sum(force * shaft.row(bearing.direction) for force, bearing in zip(forces, bearings, strict=True))
        rest = shaft.stiffness @ x - carried + 1e4 * shaft.row("F")
        assert np.max(np.abs(rest)) < 1e-6 * 1e4
        run = mp.simulate(model, 0.01, displacement=x, loads=[mp.ConstantLoad("F", -1e4)])
        assert np.max(np.abs(run.at("B", np.linspace(0, 0.01, 50)) - shaft.row("B") @ x)) < 1e-12

    def test_what_neither_forces_nor_contacts_determine_stays(self):
        """Two masses side by side, of which one is pressed on a floor."""
        model = bar([mp.UnilateralContact("a", "left", 0.01, math.inf)])
        assert_allclose(model.static_equilibrium({"left": -3.0}), [-0.01, 0.0], atol=1e-15)

    @pytest.mark.parametrize("seed", range(3))
    def test_random_bodies_satisfy_the_laws(self, seed):
        rng = np.random.default_rng(seed)
        n, rested = 5, 0
        for _ in range(20):
            rows = np.diff(np.eye(n), axis=0)
            stiffness = rows.T @ (10 ** rng.uniform(3, 6, n - 1)[:, None] * rows)
            body = mp.LinearStructure(np.diag(rng.uniform(0.5, 3, n)), stiffness, points={f"p{i}": i for i in range(n)})
            places, sides = rng.integers(n, size=6), rng.choice([-1.0, 1.0], 6)
            gaps, hard = rng.uniform(0, 5e-3, 6), np.where(rng.random(6) < 0.3, math.inf, 10 ** rng.uniform(3, 7, 6))
            contacts = [mp.UnilateralContact(f"c{i}", {f"p{places[i]}": sides[i]}, gaps[i], hard[i]) for i in range(6)]
            forces = {f"p{i}": float(rng.normal()) for i in range(n)}
            pulled = np.sign(sum(forces.values()))
            if not np.any(sides == -pulled):
                with pytest.raises(mp.MultiPhiValueError, match="that its contacts cannot carry"):
                    mp.MultiPhiModel(body, contacts).static_equilibrium(forces)
                continue
            x = mp.MultiPhiModel(body, contacts).static_equilibrium(forces)
            open_by = sides * x[places] + gaps
            directions = np.zeros((6, n))
            directions[np.arange(6), places] = sides
            rigid = np.isinf(hard)
            assert np.all(open_by[rigid] > -1e-12)
            springs = np.where(rigid, 0.0, hard) * np.maximum(-open_by, 0.0)
            rest = stiffness @ x - np.array(list(forces.values())) - directions.T @ springs
            held = directions[rigid & (open_by < 1e-12)]
            left = nnls(held.T, rest)[1] if len(held) else np.linalg.norm(rest)
            assert left < 1e-8
            rested += 1
        assert rested > 10


class TestRefuses:
    def test_a_load_that_pulls_it_off(self, refused):
        model = mass([mp.UnilateralContact("floor", "z", 0.01, 1e5)])
        begins = (
            "static equilibrium: the structure is free (1 rigid-body modes) and 100 % of the forces are not balanced"
        )
        refused(ValueError, f"{begins} that its contacts cannot carry", model.static_equilibrium, {"z": 9.81})

    def test_a_load_beside_its_supports(self, refused):
        floors = [mp.UnilateralContact("a", "mid", 0.0, 1e5), mp.UnilateralContact("b", "right", 0.0, 1e5)]
        refused(
            ValueError, "static equilibrium: the structure is free (2", bar(floors).static_equilibrium, {"left": -1.0}
        )

    def test_friction_depends_on_the_path(self, refused):
        rough = mp.UnilateralContact("floor", "left", 0.0, 1e5, friction=0.3, tangential="right")
        refused(
            ValueError, "static equilibrium: the structure is free", bar([rough]).static_equilibrium, {"left": -1.0}
        )
