"""Static response: along one direction what a dense solution of all coordinates gives, along several the solution in
exact numbers, however soft a mode is.

Beside others also where a direction hardly bends the structure, but moves it as a rigid body.
"""

import math
from fractions import Fraction

import numpy as np
import pytest
from base_levels import static_response
from numpy.testing import assert_allclose
from small_structures import chain

import multiphi_exudyn as mp


def base_of(stiffness):
    return mp.MultiPhiModel(chain(7), [mp.UnilateralContact("stop", "m5", 0.02, stiffness)], modes=4).base


def solved(base, stiffness, offset, load):
    """The same from one system of all coordinates and the force: y Omega^2 - p f = load, f / k + p.y = -offset."""
    m, p = len(load), base.directions[:, 0]
    system = np.zeros((m + 1, m + 1))
    system[:m, :m], system[:m, m], system[m, :m] = np.diag(base.squares), -p, p
    system[m, m] = 1 / stiffness
    found = np.linalg.solve(system, np.append(load, -offset))
    return found[m], found[:m]


@pytest.mark.parametrize("stiffness", [1e-3, 30.0, 1e6, math.inf])
def test_along_one_direction(stiffness):
    base = base_of(stiffness)
    load = np.random.default_rng(1).normal(size=len(base.squares))
    load.flags.writeable = False
    (force,), y = static_response(base, (0,), load)
    wanted, configuration = solved(base, stiffness, 0.02, load)
    assert force == pytest.approx(wanted, rel=1e-11)
    assert_allclose(y, configuration, rtol=0, atol=1e-12 * np.max(np.abs(configuration)))


def test_what_is_round_off_of_a_load_and_a_force_is_none():
    """A load on the stop itself is carried by the rigid stop alone."""
    base = base_of(math.inf)
    (force,), y = static_response(base, (0,), 3.0 * base.directions[:, 0], np.zeros(1))
    assert force == pytest.approx(-3.0, rel=1e-12)
    assert not y.any()


def exact(base, load):
    """y (m,) of ``solved`` with all contacts of a base, in rational numbers."""
    m, size = len(load), len(load) + len(base.stiffnesses)
    rows = [[Fraction(0)] * (size + 1) for _ in range(size)]
    for i, square in enumerate(base.squares.tolist()):
        rows[i][i], rows[i][size] = Fraction(square), Fraction(float(load[i]))
        for j, part in enumerate(base.directions[i].tolist()):
            rows[i][m + j], rows[m + j][i] = -Fraction(part), Fraction(part)
    for j, (stiffness, gap) in enumerate(zip(base.stiffnesses.tolist(), base.gaps.tolist(), strict=True), m):
        rows[j][j], rows[j][size] = 0 if math.isinf(stiffness) else 1 / Fraction(stiffness), -Fraction(gap)
    for i in range(size):
        largest = max(range(i, size), key=lambda row: abs(rows[row][i]))
        rows[i], rows[largest] = rows[largest], rows[i]
        for k in range(size):
            factor = rows[k][i] / rows[i][i] if k != i else Fraction(0)
            rows[k] = [mine - factor * other for mine, other in zip(rows[k], rows[i], strict=True)]
    return np.array([float(rows[i][size] / rows[i][i]) for i in range(m)])


@pytest.mark.parametrize("ground", [1e-11, 1e-10, 1e-9, 1e-6, 1.0])
def test_contacts_hold_a_structure_on_a_soft_spring_as_exactly_as_on_a_stiff_one(ground):
    """Beside a flexibility of 1e9 m/N that of the other modes has few digits."""
    rng = np.random.default_rng(4)
    free = chain(4, ends=0, stiffness=10.0)
    stiffness = free.stiffness + np.diag([ground, 0.0, 0.0, 0.0])
    stops = [mp.UnilateralContact(f"stop{k}", rng.normal(size=4), 0.05, (math.inf, 200.0, 11.0)[k]) for k in range(3)]
    structure = mp.LinearStructure(free.mass, stiffness, points={"m0": 0})
    model = mp.MultiPhiModel(structure, stops, modes="all")
    assert model.base.modes.rigid == 0
    load = model.base.modes.shapes.T @ np.array([1.3, 0.0, 0.0, -1.3])
    _, y = static_response(model.base, (0, 1, 2), load)
    wanted = exact(model.base, load)
    assert_allclose(y, wanted, rtol=0, atol=1e-12 * np.max(np.abs(wanted)))


@pytest.mark.parametrize("unit", [1.0, 2.0**40, 2.0**-40])
@pytest.mark.parametrize("first", [math.inf, 3.0])
@pytest.mark.parametrize("bend", [0.0, 1e-16, 1e-15, 1e-14, 1e-12, 1e-9, 1e-6, 1e-3, 1.0])
def test_a_rigid_stop_that_hardly_bends_the_structure_bears_what_equilibrium_asks(bend, first, unit):
    """Of two joined masses x, z and a free one y: k (x + z) = 2 f + h g = bend g, and y has the forces 1 and l g."""
    random = np.random.default_rng(4)
    for _ in range(20):
        k, h, length, *gaps = random.uniform(0.3, 2.0, 5)
        stiffness = unit * 10 * k * np.array([[1.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 1.0]])
        structure = mp.LinearStructure(np.diag(random.uniform(1.0, 5.0, 3)), stiffness, points={"x": 0, "y": 1, "z": 2})
        stops = (
            mp.UnilateralContact("f", {"x": 2.0}, 0.0, unit * first),
            mp.UnilateralContact("g", [h, length, bend], 0.0),
        )
        level = mp.MultiPhiModel(structure, stops, modes="all").level(("f", "g"))
        forces = level.static_response(level.base.modal_load(unit * structure.row("y")), np.array(gaps))[0]
        g = -1 / length
        assert_allclose(forces / unit, [(bend - h) / 2 * g, g], rtol=0, atol=1e-12)


@pytest.mark.parametrize("stiffness", [1000.0, 37.0, 3e6])
def test_a_stop_beside_another_that_bears_the_load_itself_has_no_force_at_all(stiffness):
    """x is free, y on a spring is held where the load acts: round-off would tell a soft stop at x - y to open."""
    structure = mp.LinearStructure(np.eye(2), np.diag([0.0, 5.0]), points={"x": 0, "y": 1})
    stops = mp.UnilateralContact("soft", {"x": 1.0, "y": -1.0}, 0.0, stiffness), mp.UnilateralContact("held", "y", 0.0)
    level = mp.MultiPhiModel(structure, stops, modes="all").level(("soft", "held"))
    forces, y = level.static_response(level.base.modal_load(structure.row("y")), np.zeros(2))
    assert forces[0] == 0.0
    assert forces[1] == pytest.approx(-1.0, rel=1e-14)
    assert y.tolist() == [0.0, 0.0]
