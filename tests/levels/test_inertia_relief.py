"""A free structure is deformed by forces that balance each other, and by others while they accelerate it."""

import numpy as np
import scipy.sparse
from numpy.testing import assert_allclose

import multiphi_exudyn as mp

N = 9
MASS = np.diag(np.linspace(1.0, 3.0, N))


def free_chain(n=N):
    rows = np.diff(np.eye(n), axis=0)
    return 1e4 * rows.T @ rows


def structure(mass=MASS, stiffness=None, **points):
    n = mass.shape[0]
    points = {"left": 0, "mid": n // 2, "right": n - 1} | points
    return mp.LinearStructure(mass, free_chain(n) if stiffness is None else stiffness, points=points)


def deformation(mass, stiffness, load):
    """By the elastic flexibility P^T K^+ P, P taking out what accelerates the body: a chain has one rigid-body mode."""
    rigid = np.ones(len(mass)) / np.sqrt(np.sum(mass))
    onto = np.eye(len(mass)) - np.outer(mass @ rigid, rigid)
    return onto.T @ (np.linalg.pinv(stiffness) @ (onto @ load))


class TestFree:
    def test_balanced_forces_stretch_it(self):
        s = structure()
        x = mp.MultiPhiModel(s).static_equilibrium({"left": -5.0, "right": 5.0})
        assert_allclose(free_chain() @ x, s.row({"left": -5.0, "right": 5.0}), atol=1e-9)
        assert abs(np.ones(N) @ MASS @ x) < 1e-13

    def test_others_are_refused_or_relieved(self, refused):
        m, forces = mp.MultiPhiModel(structure()), {"left": -1.0, "right": 4.0}
        refused(
            ValueError, "static equilibrium: the structure is free (1 rigid-body modes) and 60 %", m.equilibrium, forces
        )
        x = m.static_equilibrium(forces, inertia_relief=True)
        assert_allclose(x, deformation(MASS, free_chain(), m.structure.row(forces)), atol=1e-12)

    def test_relief_changes_nothing_of_balanced_forces(self):
        m, forces = mp.MultiPhiModel(structure()), {"left": -1.0, "mid": -1.0, "right": 2.0}
        assert_allclose(m.static_equilibrium(forces), m.static_equilibrium(forces, inertia_relief=True), rtol=0, atol=0)

    def test_a_large_one_is_deformed_as_a_small_one(self):
        """Above the number of degrees of freedom up to which all modes are computed, by few modes and static shapes."""
        n = 801
        mass, stiffness = np.eye(n), free_chain(n)
        s = structure(*(scipy.sparse.csr_array(matrix) for matrix in (mass, stiffness)))
        forces = {"left": -1.0, "mid": 2.0, "right": -1.0}
        x = mp.MultiPhiModel(s, modes=6).static_equilibrium(forces)
        need = deformation(mass, stiffness, s.row(forces))
        assert_allclose(s.point_rows @ x, s.point_rows @ need, rtol=2e-3)

    def test_at_rest_it_vibrates_and_does_not_move_off(self):
        m = mp.MultiPhiModel(structure())
        run = mp.simulate(m, 0.5, displacement=m.static_equilibrium({"left": -5.0, "right": 5.0}))
        middle = (np.ones(N) @ MASS @ run.displacement(np.linspace(0, 0.5, 50))) / np.trace(MASS)
        assert np.max(np.abs(middle)) < 1e-15

    def test_no_forces_leave_it_as_it_is(self):
        assert not np.any(mp.MultiPhiModel(structure()).static_equilibrium({}))


class TestContacts:
    def test_that_stay_open_do_not_matter(self):
        forces = {"left": -5.0, "right": 5.0}
        stop = mp.UnilateralContact("stop", "right", gap=0.0, stiffness=1e6)
        with_stop, without = (mp.MultiPhiModel(structure(), c).static_equilibrium(forces) for c in ([stop], []))
        assert_allclose(with_stop, without, rtol=0, atol=0)

    def test_that_would_be_pressed_on_are_refused(self, refused):
        m = mp.MultiPhiModel(structure(), [mp.UnilateralContact("stop", "left", gap=1e-9)])
        begins = "static equilibrium: the structure is free (1 rigid-body modes) and would press on 'stop'"
        refused(ValueError, begins, m.static_equilibrium, {"left": -5.0, "right": 5.0})

    def test_force_laws_and_friction_need_supports(self, refused):
        m = mp.MultiPhiModel(structure(), [mp.Friction("ring", "mid", 1.0)])
        begins = (
            "static equilibrium: the structure is free (1 rigid-body modes) and has force laws, friction or bounded"
        )
        refused(ValueError, begins, m.static_equilibrium, {"left": -5.0, "right": 5.0})
