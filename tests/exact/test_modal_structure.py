"""A structure by its modes alone moves as the one they are of; what they leave out is told, or completed."""

import math

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose

import multiphi_exudyn as mp

N, KEPT = 12, 5
MASS = np.diag(np.linspace(1.0, 2.0, N))
STIFFNESS = 4e4 * (2 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1))
STIFFNESS[-1, -1] /= 2
SQUARES, SHAPES = scipy.linalg.eigh(STIFFNESS, MASS)
HZ = np.sqrt(SQUARES) / (2 * math.pi)
FLEXIBILITY = np.linalg.inv(STIFFNESS)
POINTS = {"mid": 5, "tip": N - 1}
STOP = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=2e5)


def modal(count=N, **changes):
    given = {
        "frequencies": HZ[:count],
        "shapes": {name: SHAPES[i, :count] for name, i in POINTS.items()},
        "ratios": 0.01,
    }
    return mp.structure_from_modes(**given | changes)


def peak(structure):
    run = mp.simulate(model(structure), 0.2, displacement=model(structure).static_equilibrium({"tip": 80.0}))
    return run, np.max(run.contact_force("stop", np.linspace(0, 0.2, 8001)))


def model(structure):
    return mp.MultiPhiModel(structure, [STOP], modes="all")


@pytest.fixture(scope="module")
def whole():
    return peak(mp.LinearStructure(MASS, STIFFNESS, mp.ModalDamping(0.01), POINTS))


class TestModes:
    @pytest.mark.parametrize("scale", [1.0, np.linspace(0.1, 3.0, N)])
    def test_all_of_them_are_the_structure(self, whole, scale):
        """Shapes of any length, with their modal masses."""
        shapes = {name: SHAPES[i] * scale for name, i in POINTS.items()}
        run, force = peak(modal(shapes=shapes, masses=np.ones(N) * scale**2))
        t = np.linspace(0, 0.2, 201)
        assert_allclose(run.at("mid", t), whole[0].at("mid", t), rtol=0, atol=1e-10)
        assert force == pytest.approx(whole[1], rel=1e-6)

    def test_keep_frequencies_and_ratios_in_any_order(self):
        order = np.random.default_rng(0).permutation(KEPT)
        ratios = np.linspace(0.01, 0.05, KEPT)
        shapes = {"tip": SHAPES[-1, :KEPT][order]}
        level = mp.MultiPhiModel(modal(KEPT, frequencies=HZ[order], shapes=shapes, ratios=ratios[order])).level(())
        assert_allclose(level.frequencies, HZ[:KEPT])
        assert_allclose(level.ratios, ratios)


class TestFlexibility:
    def test_of_a_point_is_then_exact(self):
        given = {name: FLEXIBILITY[i, i] for name, i in POINTS.items()}
        built = modal(KEPT, flexibility=given)
        for name, value in given.items():
            x = mp.MultiPhiModel(built).static_equilibrium({name: 1.0})
            assert built.row(name) @ x == pytest.approx(value, rel=1e-12)

    def test_brings_the_peak_force_near(self, whole):
        alone, completed = (
            peak(modal(KEPT, **given))[1] for given in ({}, {"flexibility": {"tip": FLEXIBILITY[-1, -1]}})
        )
        assert abs(completed / whole[1] - 1) < 0.08 < 0.24 < alone / whole[1] - 1


class TestWarning:
    def test_names_the_contacts_where_it_is_not_known(self):
        with pytest.warns(mp.MultiPhiWarning, match=r"missing modes: .* up to 2[0-9.]+ Hz, so 'stop' acts"):
            run, _ = peak(modal(KEPT))
        assert sum(line.startswith("missing modes") for line in run.warnings) == 1


@pytest.mark.parametrize(
    ("kind", "changes", "begins"),
    [
        (ValueError, {"frequencies": [1.0]}, "shapes['mid']: got shape (12,), need (1,)"),
        (ValueError, {"frequencies": [-1.0]}, "frequencies: got -1, need finite numbers >= 0"),
        (ValueError, {"frequencies": []}, "frequencies: got shape (0,), need (r,)"),
        (TypeError, {"frequencies": [1j]}, "frequencies: got list of complex128"),
        (TypeError, {"shapes": {"tip": SHAPES[0] + 0j}}, "shapes['tip']: got ndarray of complex128"),
        (TypeError, {"shapes": {}}, "shapes: got no point, need {point:"),
        (TypeError, {"shapes": SHAPES}, "shapes: got ndarray, need {point:"),
        (ValueError, {"masses": np.zeros(N)}, "masses: got 0, need modal masses > 0"),
        (ValueError, {"ratios": 2.0}, "ratios: got 2, need fractions of critical damping below 1"),
        (ValueError, {"ratios": [0.1]}, "ratios: got shape (1,), need (12,)"),
        (
            ValueError,
            {"flexibility": {"tpi": 1.0}},
            "flexibility: got point 'tpi', need one of: mid, tip; did",
        ),
        (TypeError, {"flexibility": {"tip": "1"}}, "flexibility['tip']: got '1', need a number"),
        (TypeError, {"flexibility": [1.0]}, "flexibility: got list"),
    ],
)
def test_refuses(refused, kind, changes, begins):
    refused(kind, begins, modal, **changes)
