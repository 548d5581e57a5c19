"""Contacts with friction: flutter, its boundary, belts, lift-off, and random systems against the law alone."""

import math

import numpy as np
import pytest
import scipy.linalg
from coulomb import Coulomb
from numpy.testing import assert_allclose
from small_structures import chain

import multiphi_exudyn as mp


def flutter_structure():
    """Two degrees of freedom, m 1, springs of 11 at 150 and 20 at 30 degrees."""
    stiffness = np.zeros((2, 2))
    for k, degrees in ((11.0, 150.0), (20.0, 30.0)):
        along = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
        stiffness += k * np.outer(along, along)
    return mp.LinearStructure(np.eye(2), stiffness, points={"x": 0, "y": 1})


def critical_friction(normal=35.0):
    """(K_11 - K_22 - k)^2 + 4 K_21 (K_12 - mu k) = 0."""
    k = np.asarray(flutter_structure().stiffness)
    return (k[0, 1] + (k[0, 0] - k[1, 1] - normal) ** 2 / (4 * k[0, 1])) / normal


def flutter_model(friction, normal=35.0):
    """Pressed onto a belt that runs so fast that it always slides, at a depth that it does not leave."""
    belt = mp.UnilateralContact("belt", "y", -1.0, normal, friction=friction, tangential="x", tangential_velocity=-1e3)
    return mp.MultiPhiModel(flutter_structure(), [belt], modes="all")


def sliding_matrices(friction, normal=35.0):
    """K of x'' + K x = f, f: T = mu N pulls along the belt."""
    stiffness = np.array(flutter_structure().stiffness)
    stiffness[1, 1] += normal
    stiffness[0, 1] -= friction * normal
    return stiffness, np.array([-friction * normal, normal])


class TestFlutter:
    """Mode coupling: eigenvalues of the sliding level merge at 33, and part into a growing and a decaying pair."""

    def test_begins_where_the_eigenvalues_merge(self):
        assert critical_friction() == pytest.approx(0.80829, abs=5e-6)
        below, above = (flutter_model(critical_friction() + change) for change in (-1e-4, 1e-4))
        rates = [model.level({"belt": "slip+"}).response.basis.rates for model in (below, above)]
        assert_allclose(rates[0].real, 0.0, atol=1e-12)
        assert_allclose(rates[1] ** 2, -33.0, atol=0.2)
        assert np.max(rates[1].real) > 1e-3

    @pytest.mark.parametrize("friction", [0.3, 0.80, 0.9, 1.2])
    def test_moves_as_the_matrix_exponential_says(self, friction):
        stiffness, load = sliding_matrices(friction)
        rest, t = np.linalg.solve(stiffness, load), np.linspace(0, 4, 41)
        start = rest + np.array([1e-3, -2e-3])
        run = mp.simulate(flutter_model(friction), 4.0, displacement=start)
        assert (run.status, len(run.events)) == ("ok", 0)
        system = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, np.zeros((2, 2))]])
        given = np.concatenate([start - rest, np.zeros(2)])
        exact = np.array([rest + (scipy.linalg.expm(system * time) @ given)[:2] for time in t]).T
        assert_allclose(run.displacement(t), exact, rtol=0, atol=1e-12)
        assert_allclose(run.friction_force("belt", t), friction * run.contact_force("belt", t), rtol=1e-13)
        assert abs(run.ledger.residual) < 1e-11 * run.ledger.friction

    @pytest.mark.parametrize("beside", [0.0, 1e-15, -1e-13, 1e-11, -1e-9, 1e-7])
    def test_has_a_form_at_its_boundary_and_near_it(self, beside):
        """A double root with one mode: t exp(i w t)."""
        friction = critical_friction() * (1 + beside)
        stiffness, load = sliding_matrices(friction)
        rest, t = np.linalg.solve(stiffness, load), np.linspace(0, 20, 41)
        start = rest + np.array([1e-3, -2e-3])
        run = mp.simulate(flutter_model(friction), 20.0, displacement=start, loads=[mp.HarmonicLoad("x", 1e-3, 0.5)])
        assert run.status == "ok"
        w = math.pi
        system = np.zeros((6, 6))
        system[:2, 2:4], system[2:4, :2] = np.eye(2), -stiffness
        system[2, 4], system[4, 5], system[5, 4] = 1e-3, -w, w
        given = np.concatenate([start - rest, np.zeros(2), [1.0, 0.0]])
        exact = np.array([rest + (scipy.linalg.expm(system * time) @ given)[:2] for time in t]).T
        assert_allclose(run.displacement(t), exact, rtol=0, atol=1e-9 * np.max(np.abs(exact - rest[:, None])))
        assert abs(run.ledger.residual) < 1e-9 * run.ledger.friction


def against_the_law(model, t_end, x, v, t, loads=(), force=None, longest=0.02):
    """The run; its motion and its events are those of an integrator that knows the law alone, its ledger closes."""
    run = mp.simulate(model, t_end, displacement=x, velocity=v, loads=loads)
    assert run.status == "ok", run.message
    expected, events = Coulomb(model.structure, model.contacts, force, longest).run(t_end, x, v, t)
    assert_allclose(run.displacement(t), expected, rtol=0, atol=1e-9 * np.max(np.abs(expected)))
    for i, contact in enumerate(model.contacts):
        own = [event.time for event in run.events if event.contact == contact.name and event.kind == "close"]
        assert_allclose(own, [time for time, c, kind in events if c == i and kind == "close"], rtol=0, atol=1e-8)
    assert abs(run.ledger.residual) < 1e-11 * (run.ledger.initial + run.ledger.friction + abs(run.ledger.work_of_loads))
    return run


class TestLiftOff:
    """A sliding block under an oscillating normal load, which lifts it off: event by event as an integrator says."""

    @pytest.mark.parametrize(("spring", "static"), [(math.inf, 0.6), (60.0, None)])
    def test_as_an_integrator_says(self, spring, static):
        structure = mp.LinearStructure(
            np.diag([1.0, 0.5]), [[4.0, 0.6], [0.6, 6.0]], damping=[[0.1, 0.0], [0.0, 0.2]], points={"x": 0, "y": 1}
        )
        floor = mp.UnilateralContact(
            "floor", "y", 0.0, 80.0, friction=0.4, static_friction=static, tangential="x", tangential_stiffness=spring
        )
        loads = [mp.ConstantLoad("y", -3.0), mp.HarmonicLoad("y", 4.5, 0.7), mp.HarmonicLoad("x", 2.0, 0.31)]

        def force(t):
            return np.array([2 * math.cos(0.62 * math.pi * t), -3 + 4.5 * math.cos(1.4 * math.pi * t)])

        model = mp.MultiPhiModel(structure, [floor], modes="all")
        t = np.linspace(0, 7, 211)
        run = against_the_law(model, 7.0, np.array([0.2, -0.05]), np.array([0.3, 0.0]), t, loads, force)
        kinds = {event.kind for event in run.events}
        assert kinds >= {"open", "close", "slip"}
        assert math.isfinite(spring) or "stick" in kinds

    @pytest.mark.parametrize(
        ("spring", "damped", "static"),
        [(math.inf, True, 0.5), (math.inf, False, None), (150.0, True, None), (150.0, False, 0.5)],
    )
    def test_a_block_that_nothing_holds_slides_and_comes_to_rest(self, spring, damped, static):
        """Zero frequency along the floor: the swinging pressure drives it, and it drives nothing."""
        elastic = np.array([[0.0, 0.0, 0.0], [0.0, 30.0, -30.0], [0.0, -30.0, 30.0]])
        damping = 0.01 * elastic + np.diag([0.2, 0.0, 0.0]) if damped else None
        structure = mp.LinearStructure(
            np.diag([1.0, 1.0, 0.5]), elastic, damping=damping, points={"x": 0, "y": 1, "z": 2}
        )
        floor = mp.UnilateralContact(
            "floor", "y", 0.0, 200.0, friction=0.3, static_friction=static, tangential="x", tangential_stiffness=spring
        )
        weight = mp.ConstantLoad({"y": 1.0, "z": 0.5}, -9.81)

        def force(t):
            return np.array([6 * math.cos(0.8 * math.pi * t), -9.81, -0.5 * 9.81])

        start = np.array([0.0, -0.03, -0.2]), np.array([1.0, 0.0, 0.5])
        model = mp.MultiPhiModel(structure, [floor], modes="all")
        loads = [weight, mp.HarmonicLoad("x", 6.0, 0.4)]
        run = against_the_law(model, 5.0, *start, np.linspace(0, 5, 101), loads, force)
        assert len(run.events) > 4


def random_case(seed):
    """2 to 4 degrees of freedom, a random structure, one contact or two, constant and harmonic loads."""
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 5))
    root = random.normal(size=(n, n))
    stiffness = 8 * root @ root.T + np.diag(random.uniform(2, 20, n))
    damping = None
    if random.random() < 0.5:
        root = random.normal(size=(n, n)) * 0.15
        damping = root @ root.T
    mass, points = np.diag(random.uniform(0.5, 2, n)), {f"m{i}": i for i in range(n)}
    structure, contacts = mp.LinearStructure(mass, stiffness, damping=damping, points=points), []
    for i in range(1 if n < 4 else int(random.integers(1, 3))):
        a, b = random.permutation(n)[:2] if n < 4 else ((0, 1), (2, 3))[i]
        spring = math.inf if random.random() < 0.5 else 10 ** random.uniform(1, 3)
        dashpot = random.uniform(0.1, 1) if math.isinf(spring) and random.random() < 0.4 else 0.0
        friction = random.uniform(0.1, 1.2)
        contacts.append(
            mp.UnilateralContact(
                f"c{i}", f"m{a}", float(random.choice([-0.1, 0.02, 0.1])), 10 ** random.uniform(1, 2.5), dashpot,
                friction=friction, tangential=f"m{b}", static_friction=friction * float(random.choice([1, 1.3])),
                tangential_stiffness=spring, tangential_velocity=float(random.choice([0.0, 0.3])),
            )
        )  # fmt: skip
    constant, size, w = random.normal(size=n), random.uniform(0.5, 4), random.uniform(1, 4)
    at, start = int(random.integers(n)), (random.normal(size=n) * 0.1, random.normal(size=n) * 0.5)
    loads = [
        mp.ConstantLoad({f"m{i}": float(f) for i, f in enumerate(constant)}, 1.0),
        mp.HarmonicLoad(f"m{at}", size, w / (2 * math.pi)),
    ]

    def force(t):
        return constant + size * math.cos(w * t) * np.eye(n)[at]

    return mp.MultiPhiModel(structure, contacts, modes="all"), start, loads, force


@pytest.mark.parametrize("seed", [0, 1, 3, 4, 5, 7, 11])  # of every kind, alone and in pairs
def test_random_systems_move_as_an_integrator_says(seed):
    model, (x, v), loads, force = random_case(seed)
    against_the_law(model, 3.0, x, v, np.linspace(0, 3, 76), loads, force, longest=0.01)


class TestUniqueness:
    """Painleve's rod, m 1, half length 1, J 1/3, on one end at an angle: no unique sliding from mu 4/3 on."""

    def model(self, friction):
        angle = math.atan(2.0)
        mass = np.diag([1.0, 1.0, 1 / 3])
        structure = mp.LinearStructure(mass, np.zeros((3, 3)), points={"x": 0})
        normal, along = np.array([0.0, 1.0, -math.cos(angle)]), np.array([1.0, 0.0, math.sin(angle)])
        floor = mp.UnilateralContact("floor", normal, 0.0, friction=friction, tangential=along)
        return mp.MultiPhiModel(structure, [floor], modes="all")

    def test_is_refused_with_its_number_above_it(self):
        tried = []
        for state in ("slip+", "slip-"):
            try:
                self.model(1.4).level({"floor": state})
            except mp.NumericalFailure as failure:
                tried.append(str(failure))
        assert len(tried) == 1
        share = 1 - 1.4 * 3 * 2 / (1 + 4 + 3)  # 1 - mu 3 sin cos / (1 + 3 cos^2)
        assert f"h.M^-1 (h - s mu h_t) is {share:.6g} of h.M^-1 h" in tried[0]


class TestRigidLevels:
    """The limit of ever stiffer contacts."""

    def model(self, stiffness, modes="all"):
        contact = mp.UnilateralContact("c", "m7", 0.0, stiffness, friction=0.6, tangential={"m4": 1.0, "m2": -0.3})
        return mp.MultiPhiModel(chain(8, stiffness=10.0), [contact], modes=modes)

    @pytest.mark.parametrize("state", ["slip+", "slip-"])
    def test_are_those_of_stiff_contacts(self, state):
        rigid = self.model(math.inf).level({"c": state})
        errors = []
        for stiffness in (1e5, 1e7):
            stiff = self.model(stiffness).level({"c": state})
            near = [np.sort(level.response.basis.rates.imag)[:7] for level in (rigid, stiff)]
            errors.append(np.max(np.abs(near[1] - near[0])))
            assert_allclose(stiff.asymptotic_configuration, rigid.asymptotic_configuration, atol=1e-12)
        assert errors[0] < 1e-3
        assert errors[1] < 0.02 * errors[0]


def pads(rows, limits, static=1.0, element="block", normal=(100.0, 3.0)):
    """A unit mass (n,) on pads of constant pressure, each a block, or a contact beside a degree of freedom of its own.

    Structure, elements and the start that presses.
    """
    rows, n, count = np.array(rows, float), len(rows[0]), len(rows)
    stiffness, damping = normal
    structure = mp.LinearStructure(np.eye(n + count), np.diag([1.0] * n + [stiffness] * count))
    start, elements = np.r_[np.zeros(n), np.full(count, 0.1)], []
    for i, (row, limit) in enumerate(zip(rows, limits, strict=True)):
        along, across = np.r_[row, np.zeros(count)], np.eye(n + count)[n + i]
        if element == "block":
            elements.append(mp.Friction(f"f{i}", along, limit, static * limit))
            continue
        mu, given = limit / (0.1 * stiffness), {"damping": damping if element == "viscous" else 0.0}
        given |= {"friction": mu, "static_friction": static * mu, "tangential": along}
        elements.append(mp.UnilateralContact(f"f{i}", across, -0.2, stiffness, **given))
    return structure, elements, start
