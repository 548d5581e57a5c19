"""Force laws: segments of second order, chains of levels that follow the true law, energy that is kept."""

import math
import warnings
from typing import ClassVar

import numpy as np
import pytest
import scipy.integrate
from numpy.testing import assert_allclose
from small_structures import chain
from true_law import force_of_links, with_forces

import multiphi_exudyn as mp

START = np.array([0.3, 0.8, 1.5])
T = np.linspace(0, 10, 201)
SPAN = (-2.0, 2.0)


def hardening(q):
    return q + 2 * q**3


def hertz(q):
    return -50 * np.maximum(-q - 0.2, 0) ** 1.5


def softening(q):
    return -0.35 * q + 0.3 * q**3


def two_wells(q):
    return -q + 0.5 * q**3


def magnet(q):
    return -0.3 / (2.5 - q) ** 2


def clearance(q):
    return 5 * (np.hypot(q - 0.5, 0.1) + q - 0.5) - 5 * (np.hypot(-q - 0.5, 0.1) - q - 0.5)


LAWS = {
    "hardening": (hardening, START),
    "hertz": (hertz, START),
    "softening": (softening, START),
    "two wells": (two_wells, np.array([0.3, 0.8, 1.95])),
    "magnet": (magnet, np.array([0.3, 0.8, 1.2])),
    "clearance": (clearance, np.array([0.3, 0.8, 1.2])),
}


UNLIKE = ("hertz", "two wells", "magnet", "clearance")  # one of every shape: they are fitted finely

MADE = {}


def law(function=hardening, at="m2", **given):
    """What its arguments make, once."""
    given = {"span": SPAN} | ({} if "tolerance" in given else {"segments": 32}) | given
    key = function, str(at), *sorted(given.items())
    if key not in MADE:
        MADE[key] = mp.ForceLaw(at, function, **given)
    return MADE[key]


def model(*contacts, n=3, **given):
    return mp.MultiPhiModel(chain(n, **given), contacts, modes="all")


def relative(found, expected):
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


class TestSegments:
    @pytest.mark.parametrize("name", UNLIKE)
    def test_their_error_falls_with_the_square_of_their_number(self, name):
        errors = [law(LAWS[name][0], segments=n).error for n in (32, 128)]
        assert np.log2(errors[0] / errors[1]) / 2 > 1.9
        assert errors[-1] < 7e-4

    @pytest.mark.parametrize(("name", "tolerance"), [*((name, 1e-2) for name in LAWS), ("hertz", 1e-3)])
    def test_hold_their_tolerance_and_lie_on_the_law_at_their_knots(self, name, tolerance):
        function = LAWS[name][0]
        found, q = law(function, tolerance=tolerance), np.linspace(*SPAN, 9973)
        off = np.max(np.abs(found.force(q) - function(q))) / np.max(np.abs(function(q)))
        assert 0.5 * tolerance < off <= 1.001 * tolerance
        assert off == pytest.approx(found.error, rel=0.01)
        assert_allclose(found.forces, function(found.knots), rtol=1e-14)
        fewer = law(function, segments=len(found.knots) - 2)
        assert fewer.error > tolerance, "one segment less would not do"

    @pytest.mark.parametrize("name", LAWS)
    def test_are_what_the_links_of_each_state_make(self, name):
        found, q = law(LAWS[name][0]), np.linspace(-3, 3, 301)
        assert_allclose(force_of_links(found, q), found.force(q), rtol=0, atol=1e-12 * np.max(np.abs(found.force(q))))

    @pytest.mark.parametrize("name", LAWS)
    def test_have_the_integral_of_the_force_for_energy(self, name):
        found, q = law(LAWS[name][0]), np.linspace(-3, 3, 20_001)
        energy = found.energy(q)
        assert float(found.energy(found.centre)) == 0
        assert_allclose(np.gradient(energy, q)[1:-1], found.force(q)[1:-1], atol=1e-3 * np.max(np.abs(found.force(q))))

    @pytest.mark.parametrize(
        ("kind", "given", "begins"),
        [
            (ValueError, {}, "force law 'law': got tolerance None and segments None"),
            (ValueError, {"tolerance": 0.1, "segments": 3}, "force law 'law': got tolerance 0.1 and segments 3"),
            (ValueError, {"tolerance": 0.0}, "force law 'law' tolerance: got 0.0"),
            (ValueError, {"tolerance": 1.0}, "force law 'law' tolerance: got 1.0"),
            (ValueError, {"tolerance": 1e-9}, "force law 'law' tolerance: got 1e-09, which needs more"),
            (TypeError, {"tolerance": "fine"}, "force law 'law' tolerance: got 'fine'"),
            (TypeError, {"segments": 2.5}, "force law 'law' segments: got 2.5"),
            (ValueError, {"segments": 1}, "force law 'law' segments: got 1"),
            (TypeError, {"segments": 4, "span": None}, "force law 'law' span: got None"),
            (ValueError, {"segments": 4, "span": (1.0, 1.0)}, "force law 'law' span: got (1.0, 1.0)"),
            (ValueError, {"segments": 4, "span": (0.0, math.inf)}, "force law 'law' span: got (0.0, inf)"),
            (TypeError, {"segments": 4, "name": ""}, "force law name: got ''"),
            (ValueError, {"segments": 4, "law": lambda q: 0 * q}, "force law 'law' law: got a constant force"),
            (ValueError, {"segments": 4, "law": np.log}, "force law 'law' law: gives no"),
            (TypeError, {"segments": 4, "law": lambda q: "stiff"}, "force law 'law' law: fails"),
            (TypeError, {"law": 3.0, "span": None}, "force law 'law' law: got float"),
            (ValueError, {"law": ([0, 1], [0, 1])}, "force law 'law' span: got (-1, 1) for a table"),
            (ValueError, {"law": ([0, 1, 1], [0, 1, 2]), "span": None}, "force law 'law' law: got a table"),
            (ValueError, {"law": ([0, 1], [0, math.nan]), "span": None}, "force law 'law' law: got a table"),
            (ValueError, {"law": ([0, 1], [0, 1, 2]), "span": None}, "force law 'law' law: got shapes"),
        ],
    )
    @pytest.mark.filterwarnings("ignore::RuntimeWarning")
    def test_refuse(self, refused, kind, given, begins):
        refused(kind, begins, mp.ForceLaw, **{"at": "m0", "law": hardening, "span": (-1, 1)} | given)


class TestModel:
    def test_a_table_of_two_lines_is_a_compliant_contact(self):
        stop = mp.UnilateralContact("stop", "m2", 0.3, 50.0)
        table = mp.ForceLaw("m2", ([-1, -0.3, 2], [-35, 0, 0]))
        expected, found = (mp.simulate(model(c), 20.0, displacement=START) for c in (stop, table))
        assert_allclose(found.displacement(T), expected.displacement(T), rtol=0, atol=1e-13)
        assert [e.time for e in found.events] == pytest.approx([e.time for e in expected.events], rel=1e-13)
        assert found.stats.levels_possible == expected.stats.levels_possible == 2
        (own,) = found.model.contacts
        (spring,) = own.further
        assert (own.stiffness, spring.gap, spring.stiffness) == (0.0, 0.3, 50.0)
        assert_allclose(found.contact_force("law", T), expected.contact_force("stop", T), rtol=0, atol=1e-11)
        assert_allclose(found.contact_intervals("law"), expected.contact_intervals("stop"), rtol=1e-13)


class TestMotion:
    @pytest.mark.parametrize("name", UNLIKE)
    def test_follows_the_true_law_with_order_two(self, name):
        function, start = LAWS[name]
        row = np.array([0.0, 0.0, 1.0])
        true = with_forces(chain(3), T, lambda t, x, v: -row * function(row @ x), start, rtol=1e-10)
        errors = []
        for segments in (32, 128):
            run = mp.simulate(model(law(function, segments=segments)), 10.0, displacement=start)
            assert run.status == "ok"
            assert np.ptp(run.energy(T)) < 1e-9 * np.max(np.abs(run.energy(T)))
            assert abs(run.ledger.residual) < 1e-12
            errors.append(relative(run.displacement(T), true))
        assert np.log2(errors[0] / errors[1]) / 2 > 1.8
        assert errors[1] < 1.2e-3

    def test_a_step_across_many_segments_at_one_instant_is_found(self):
        """Two modes cannot hold the start, so that the law finds itself elsewhere."""
        structure, own = chain(6), law(hardening, "m5", segments=200)
        stop = mp.UnilateralContact("stop", "m1", 0.2)
        start = np.linspace(0, 1.5, 6)
        m = mp.MultiPhiModel(structure, [own, stop], modes=2)
        run = mp.simulate(m, 30.0, displacement=start)
        assert run.status == "ok"
        at_once = [int(event.state) for event in run.events if event.time == 0]
        before = int(own.first_state(1.5, 0.0))
        assert max(abs(a - b) for a, b in zip([before, *at_once], at_once, strict=False)) > 1, "at once into it"
        assert len(at_once) < abs(before - at_once[-1]), "not one by one"
        assert len(set(at_once)) == len(at_once), "and not to and fro"
        t = np.linspace(0, run.t_end, 1001)
        off = np.abs(run.contact_force("law", t) + own.force(run.at("m5", t)))
        assert np.max(off) < 1e-4 * np.max(np.abs(own.forces))
        assert abs(run.ledger.residual) < 1e-12 * run.ledger.initial


class TestEquilibrium:
    def test_balances_structure_law_and_load(self):
        m = model(law(hardening, segments=200))
        x = m.static_equilibrium({"m2": 3.0})
        (own,) = m.force_laws
        assert_allclose(m.structure.stiffness @ x, [0, 0, 3.0 - float(own.force(x[2]))], atol=1e-13)
        assert x[2] > 0.8

    @pytest.mark.parametrize("force", [-3.0, 0.0, 1.0, 3.0])
    def test_a_run_from_it_stays_there_with_contacts_and_preload(self, force):
        contacts = [
            law(hardening, segments=20),
            mp.UnilateralContact("rigid", {"m1": -1.0}, 0.2),
            mp.UnilateralContact("pushed in", {"m0": -1.0}, -0.05),
            law(lambda q: 2 * (q + 0.3), "m1", segments=4, name="off centre"),
        ]
        m = model(*contacts)
        x = m.static_equilibrium({"m2": force})
        run = mp.simulate(m, 5.0, displacement=x, loads=[mp.ConstantLoad("m2", force)])
        assert np.max(np.abs(run.displacement(T[:100]).T - x)) < 1e-13


class TestWhatAToleranceDoesToAMotion:
    """An error of the force shifts the frequency: judged by the law itself."""

    LAWS: ClassVar = {
        "cubic": lambda q: q**3,
        "Hertz": lambda q: 2.0 * np.maximum(q, 0.0) ** 1.5,
        "magnets": lambda q: q + 0.15 * (1 / (2.6 + q) ** 2 - 1 / (2.6 - q) ** 2),
        "softening": lambda q: np.tanh(q),
    }

    def run(self, law, speed, periods, unit=1.0, damping=1e-3):
        k = np.array([[2.0, -1.0], [-1.0, 1.0]])
        structure = mp.LinearStructure(np.eye(2), k, damping * k, {"a": 0, "b": 1})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mp.MultiPhiWarning)
            return mp.simulate(
                mp.MultiPhiModel(structure, [law], modes="all"), 2 * math.pi * periods, velocity=[0.0, speed * unit]
            )

    def exact(self, kind, speed, t, damping=1e-3):
        k = np.array([[2.0, -1.0], [-1.0, 1.0]])

        def rates(_, z):
            return np.r_[z[2:], -k @ z[:2] - damping * k @ z[2:] - [0.0, self.LAWS[kind](z[1])]]

        answer = scipy.integrate.solve_ivp(
            rates, (0, t[-1]), [0, 0, 0, speed], "DOP853", t_eval=t, rtol=1e-8, atol=1e-10
        )
        return answer.y[:2]

    @pytest.mark.parametrize("kind", LAWS)
    @pytest.mark.parametrize("tolerance", [2e-2, 2e-3, 2e-4])
    @pytest.mark.parametrize(("speed", "periods"), [(0.2, 8.0), (1.0, 20.0)])
    def test_is_told_where_it_is_wrong_and_not_where_it_is_right(self, kind, tolerance, speed, periods):
        def of(accuracy):
            return mp.ForceLaw("b", self.LAWS[kind], tolerance=accuracy, span=(-2.0, 2.0))

        run = self.run(of(tolerance), speed, periods)
        t = np.linspace(0.0, run.t_end, 1001)
        expected = self.exact(kind, speed, t)
        error = np.linalg.norm(run.displacement(t) - expected) / np.linalg.norm(expected)
        told = [text for text in run.warnings if text.startswith("force law: ")]
        assert len(told) >= (error > 0.05)
        assert len(told) <= (error > 0.004)
        if told and tolerance == 2e-2 and speed == 1.0:
            finer = self.run(of(float(told[0].split("tolerance=")[1])), speed, periods)
            assert finer.warnings == ()
            rest = np.linalg.norm(finer.displacement(t) - expected) / np.linalg.norm(expected)
            assert rest < 0.02
