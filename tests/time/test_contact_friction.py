"""Contacts with friction: flutter, its boundary, belts, lift-off, and random systems against the law alone."""

import itertools
import math
import warnings

import numpy as np
import pytest
import scipy.linalg
from coulomb import Coulomb
from numpy.testing import assert_allclose
from small_structures import chain, stop

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

    def test_grows_at_its_rate(self):
        rates = flutter_model(0.9).level({"belt": "slip+"}).response.basis.rates
        assert_allclose(np.sort_complex(rates**2), np.sort_complex(-np.linalg.eigvals(sliding_matrices(0.9)[0])))
        assert np.max(rates.real) == pytest.approx(0.30740093, abs=1e-8)

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

    def test_until_it_lifts_off_and_returns(self):
        t = np.linspace(0, 12, 241)
        given = [mp.UnilateralContact("belt", "y", -1.0, 35.0, friction=1.1, tangential="x", tangential_velocity=-0.4)]
        model = mp.MultiPhiModel(flutter_structure(), given, modes="all")
        against_the_law(model, 12.0, np.array([0.1, 0.9]), np.zeros(2), t)


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


class TestBelt:
    """A block pressed onto a belt by a compliant contact, m 1, k 25, V .3, N 10, mu .2, mu_s .35."""

    @pytest.mark.parametrize("turned", [1.0, -1.0])
    def test_has_its_period(self, turned):
        """The mass has no normal inertia of its own to swing with: N is what presses it, 10."""
        structure = mp.LinearStructure(np.eye(2), np.diag([25.0, 1e-3]), points={"x": 0, "y": 1})
        belt = mp.UnilateralContact(
            "belt", "y", 0.0, 100.0, friction=0.2, static_friction=0.35, tangential={"x": turned},
            tangential_velocity=0.3,
        )  # fmt: skip
        load = mp.ConstantLoad("y", -10.0 - 1e-4)  # what the contact and the small spring carry at a depth of .1
        run = mp.simulate(
            mp.MultiPhiModel(structure, [belt], modes="all"), 12.0, displacement=[0.0, -0.1],
            velocity=[0.3 * turned, 0], loads=[load],
        )  # fmt: skip
        slips = [event.time for event in run.events if event.kind == "slip"]
        assert len(slips) == 9
        assert_allclose(np.diff(slips), 1.3424777960769378, rtol=1e-9)
        assert_allclose(run.contact_force("belt", np.linspace(0, 12, 25)), 10.0, rtol=1e-9)
        assert len(run.stick_intervals("belt")) >= 9


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

    def test_mirrored_is_mirrored(self):
        structure = chain(3, stiffness=9.0)
        runs = []
        for sign in (1.0, -1.0):
            floor = mp.UnilateralContact("floor", "m0", 0.01, 50.0, friction=0.5, tangential={"m2": sign})
            model = mp.MultiPhiModel(structure, [floor], modes="all")
            runs.append(mp.simulate(model, 8.0, velocity=[-1.0, 0.3, 0.5]))
        assert [e.time for e in runs[0].events] == [e.time for e in runs[1].events]
        assert len(runs[0].events) > 5


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


def sprung_floor_model():
    """A floor that gives way beneath a block, which rubs by a spring and has a static limit."""
    mass = np.diag([1.0, 0.6, 1.2])
    stiffness = np.array([[8.0, -3.0, 0.8], [-3.0, 9.0, 1.0], [0.8, 1.0, 12.0]])
    damping = np.diag([0.05, 0.03, 0.025]) + 0.02 * stiffness
    structure = mp.LinearStructure(mass, stiffness, damping=damping, points={"x": 0, "z": 1, "y": 2})
    floor = mp.UnilateralContact(
        "floor", "y", 0.0, 80.0, friction=0.3, static_friction=0.5, tangential="x", tangential_stiffness=60.0
    )
    return mp.MultiPhiModel(structure, [floor], modes="all")


def test_a_spring_that_lets_go_while_the_pressure_falls_faster_sticks_again_at_once():
    """Its patch would slide back: the force has fallen from the static limit, and the motion goes on without a slip."""
    run = against_the_law(
        sprung_floor_model(), 6.0, np.array([0.4, 0.6, -0.08]), np.array([0.3, 0.0, 0.0]), np.linspace(0, 6, 201),
        [mp.ConstantLoad("y", -1.5)], lambda t: np.array([0.0, 0.0, -1.5]),
    )  # fmt: skip
    first, second = run.events[:2]
    assert (first.kind, second.kind) == ("slip", "stick")
    assert first.time == second.time
    before, after = (run.friction_force("floor", first.time, side) for side in ("left", "right"))
    assert before == pytest.approx(0.5 * run.contact_force("floor", first.time), rel=1e-12)
    assert after == pytest.approx(0.3 * run.contact_force("floor", first.time), rel=1e-12)
    assert first.loss.friction == pytest.approx((before**2 - after**2) / (2 * 60.0), rel=1e-12)
    assert first.state == "slip+"


@pytest.mark.parametrize(
    ("x", "v"),
    [([0.2, 0.1, -0.07], [1.4, 0.4, -0.7]), ([-0.25, 0.2, -0.2], [1.6, -0.3, -0.4])],
)
def test_and_where_its_patch_would_slide_back_ever_more_slowly(x, v):
    """It does not wait, in a slip against its direction, until that has come to rest."""
    run = against_the_law(
        sprung_floor_model(), 3.0, np.array(x), np.array(v), np.linspace(0, 3, 101),
        [mp.ConstantLoad("y", -1.5)], lambda t: np.array([0.0, 0.0, -1.5]),
    )  # fmt: skip
    at_once = [b for a, b in itertools.pairwise(run.events) if (a.kind, b.kind, a.time) == ("slip", "stick", b.time)]
    assert at_once


@pytest.mark.parametrize(("static", "spring"), [(None, math.inf), (0.6, 40.0)])
def test_forces_balance_beside_a_rigid_stop(static, spring):
    """M x'' + K x = f + h N - h_t T + h_1 lambda, x'' from differences of x'."""
    structure = chain(5, stiffness=9.0)
    floor = mp.UnilateralContact(
        "floor", "m4", -0.05, 60.0, friction=0.5, static_friction=static, tangential="m2", tangential_stiffness=spring
    )
    model = mp.MultiPhiModel(structure, [floor, stop("m1", 0.0)], modes="all")
    loads = [mp.HarmonicLoad("m3", 3.0, 0.45), mp.ConstantLoad("m1", -1.5), mp.ConstantLoad("m4", -1.0)]
    run = mp.simulate(model, 6.0, velocity=[0.0, 0.0, 0.6, 0.0, 0.0], loads=loads)
    assert {(e.contact, e.kind) for e in run.events} >= {("stop", "close"), ("stop", "open"), ("floor", "open")}
    assert {e.kind for e in run.events if e.contact == "floor"} == {"close", "open", "stick", "slip"}
    instants, d = np.array([event.time for event in run.events]), 1e-4
    t = np.array([time for time in np.linspace(0.05, 5.9, 200) if np.min(np.abs(instants - time)) > 2 * d])
    force = np.outer(np.eye(5)[3], 3 * np.cos(0.9 * math.pi * t)) - np.outer([0, 1.5, 0, 0, 1.0], np.ones(len(t)))
    force += np.outer(np.eye(5)[4], run.contact_force("floor", t)) - np.outer(
        np.eye(5)[2], run.friction_force("floor", t)
    )
    force += np.outer(np.eye(5)[1], run.contact_force("stop", t))
    acceleration = (run.velocity(t + d) - run.velocity(t - d)) / (2 * d)
    left = acceleration + np.asarray(structure.stiffness) @ run.displacement(t) - force
    assert_allclose(left, 0.0, atol=1e-5)
    products = len(run.segments) * (2 * 5) ** 2  # of two exponentials each, of which the works of a segment are sums
    turned_over = run.ledger.initial + run.ledger.work_of_loads + run.ledger.friction + run.ledger.impact
    assert abs(run.ledger.residual) < np.finfo(float).eps * products * turned_over


class TestTruncated:
    def test_levels_converge_to_all_modes(self):
        structure = chain(12, stiffness=400.0, damping=mp.ModalDamping(0.01))
        found, t = [], np.linspace(0, 3, 301)
        for modes in ("all", 4, 6, 9):
            floor = mp.UnilateralContact("floor", "m11", 0.0, 300.0, friction=0.3, tangential={"m8": 1.0, "m5": -0.5})
            model = mp.MultiPhiModel(structure, [floor], modes=modes)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                run = mp.simulate(model, 3.0, loads=[mp.HarmonicLoad("m10", 3.0, 0.8), mp.ConstantLoad("m11", -2.0)])
            assert run.status == "ok"
            size = run.ledger.initial + abs(run.ledger.work_of_loads) + run.ledger.friction
            assert abs(run.ledger.residual) < 1e-11 * size
            found.append(run.at("m8", t))
        errors = [np.linalg.norm(y - found[0]) / np.linalg.norm(found[0]) for y in found[1:]]
        assert errors[2] < errors[0] / 3
        assert errors[2] < 0.02


class TestUniqueness:
    """Painleve's rod, m 1, half length 1, J 1/3, on one end at an angle: no unique sliding from mu 4/3 on."""

    def model(self, friction):
        angle = math.atan(2.0)
        mass = np.diag([1.0, 1.0, 1 / 3])
        structure = mp.LinearStructure(mass, np.zeros((3, 3)), points={"x": 0})
        normal, along = np.array([0.0, 1.0, -math.cos(angle)]), np.array([1.0, 0.0, math.sin(angle)])
        floor = mp.UnilateralContact("floor", normal, 0.0, friction=friction, tangential=along)
        return mp.MultiPhiModel(structure, [floor], modes="all")

    @pytest.mark.parametrize("state", ["slip+", "slip-"])
    def test_holds_below_the_critical_coefficient(self, state):
        assert self.model(1.3333).level({"floor": state}).modes == 2

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

    def test_of_few_modes_converge(self):
        whole = np.sort(self.model(math.inf).level({"c": "slip+"}).response.basis.rates.imag)[:2]
        found = [self.model(math.inf, modes).level({"c": "slip+"}) for modes in (3, 5, 6)]
        errors = [np.max(np.abs(np.sort(level.response.basis.rates.imag)[:2] - whole)) for level in found]
        assert errors[2] < errors[0]
        assert errors[2] < 2e-3


class TestArguments:
    @pytest.mark.parametrize(
        ("given", "message"),
        [
            ({"friction": -0.1, "tangential": "x"}, "friction: got -0.1, need a finite coefficient >= 0"),
            ({"friction": 0.3}, "friction: got 0.3 without a tangential direction, need one as well"),
            (
                {"friction": 0.3, "tangential": "x", "static_friction": 0.2},
                "static_friction: got 0.2, need a finite coefficient >= the friction 0.3",
            ),
            (
                {"friction": 0.3, "tangential": "x", "tangential_stiffness": 0.0},
                "tangential_stiffness: got 0.0, need a value > 0",
            ),
            (
                {"friction": 0.3, "tangential": "x", "tangential_stiffness": 9.0, "stiffness": math.inf},
                "tangential_stiffness: got 9.0 beside an infinite stiffness, need inf, or an elastic contact",
            ),
            (
                {"friction": 0.3, "tangential": "x", "tangential_stiffness": 9.0, "damping": 1.0},
                "tangential_stiffness: got 9.0 beside the damping 1.0, need inf, or an elastic contact",
            ),
        ],
    )
    def test_are_refused(self, given, message):
        with pytest.raises(mp.MultiPhiValueError, match=message):
            mp.UnilateralContact("c", "y", 0.0, **{"stiffness": 10.0, **given})

    def test_without_friction_nothing_changes(self):
        plain, zero = (mp.UnilateralContact("c", "y", 0.1, 5.0, **k) for k in ({}, {"tangential": "x"}))
        assert plain.states == zero.states
        assert not zero.further


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


@pytest.mark.parametrize("seed", [1, 2])
def test_contacts_of_constant_pressure_are_blocks(seed):
    """Static limits that several reach at once, which of them slip and which turn: as blocks of the limits mu N."""
    random = np.random.default_rng(seed)
    rows, limits, static = random.normal(size=(3, 3)), random.uniform(0.2, 1.0, 3), 1.5
    pulls, speed, t = 2 * random.normal(size=(2, 3)), random.normal(size=3), np.linspace(0, 6, 31)
    runs = []
    for element in ("block", "compliant", "viscous"):
        structure, elements, pressed = pads(rows, limits, static, element)
        loads = [
            mp.ConstantLoad(np.r_[pulls[0], np.zeros(3)], 1.0),
            mp.HarmonicLoad(np.r_[pulls[1], np.zeros(3)], 1.0, 0.4),
        ]
        model = mp.MultiPhiModel(structure, elements, modes="all")
        runs.append(mp.simulate(model, 6.0, pressed, np.r_[speed, np.zeros(3)], loads))
    assert [run.status for run in runs] == ["ok"] * 3
    for run in runs[1:]:
        assert_allclose(run.displacement(t)[:3], runs[0].displacement(t)[:3], atol=1e-9)
        assert [e.kind for e in run.events] == [e.kind for e in runs[0].events]


@pytest.mark.parametrize("element", ["compliant", "viscous"])
@pytest.mark.parametrize(
    ("limits", "comes_to_rest"),
    [((0.3, 0.1), False), ((0.3, 0.3), False), ((1.0, 0.4), False), ((2.0, 1.0), True)],
)
def test_two_at_one_place_let_go_together_whatever_round_off_says(limits, comes_to_rest, element):
    """The second one lets go where both bear their limits: the first one slips on, it does not stick for no time.

    Limits that differ in the last digits change no event.
    """
    load, found = mp.HarmonicLoad([1.0, 0.0, 0.0], 5.0, 0.25, -np.pi / 2), set()
    for digits in itertools.product(range(-2, 3), repeat=2):
        near = np.array(limits) * (1.0 + np.finfo(float).eps * np.array(digits))
        structure, elements, pressed = pads([[1.0], [1.0]], near, element=element)
        run = mp.simulate(mp.MultiPhiModel(structure, elements, modes="all"), 3.0, pressed, loads=[load])
        found.add(tuple(f"{event.contact} {event.state}" for event in run.events))
    expected = ["f0 slip+", "f1 stick", "f1 slip+"]
    if comes_to_rest:
        expected += ["f0 stick", "f1 idle", "f0 slip-", "f1 stick", "f1 slip-"]
    else:
        expected += ["f0 slip-", "f1 slip-"]
    assert found == {tuple(expected)}
