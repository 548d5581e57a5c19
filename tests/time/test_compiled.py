"""The compiled loop gives the NumPy loop's answer: same events, phases, losses and messages, states to round-off."""

import importlib
import math
import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose
from random_campaign import verdicts
from small_structures import bed, chain, oscillator, random_model, stop

import multiphi_exudyn as mp
from multiphi_exudyn.errors import MultiPhiError
from multiphi_exudyn.events.state import Phase
from multiphi_exudyn.time.motion import Motion
from reference_models.rig import rig_beam, rig_contact, rig_damping

DAMPINGS = ("none", "modal", "rayleigh", "given")
KINDS = ("mixed", "rigid", "compliant")
MOTION = sys.modules[Motion.__module__]


def rig(stiffness, modes, elements=57, damping=rig_damping):
    structure = mp.planar_beam(rig_beam(), elements=elements, damping=damping())
    model = mp.MultiPhiModel(structure, [rig_contact(stiffness)], modes=modes)
    unit = model.static_equilibrium({"node3": 1e-3})
    return model, unit * 0.020 / float(structure.row("node3") @ unit)


def both(model, t_end, **given):
    return tuple(mp.simulate(model, t_end, compiled=compiled, **given) for compiled in (False, True))


def by_numpy(run):
    """Segments that the compiled loop left to the other one, counted before anybody looks at any."""
    return len(run.segments._known)


def assert_same(expected, found, tolerance):
    """Same decisions; times and losses within ``tolerance`` of the run's length and energy."""
    assert (found.status, found.message) == (expected.status, expected.message)
    assert [(e.contact, e.kind) for e in found.events] == [(e.contact, e.kind) for e in expected.events]
    assert len(found.segments) == len(expected.segments)
    stats = ("levels_possible", "transitions", "events", "segments")
    assert all(getattr(found.stats, name) == getattr(expected.stats, name) for name in stats)
    energy = max(expected.ledger.initial, abs(expected.ledger.work_of_loads))
    near = {"rtol": 0, "atol": tolerance * expected.t_end}
    assert_allclose([e.time for e in found.events], [e.time for e in expected.events], **near)
    for part in ("impact", "truncation_kinetic", "truncation_strain"):
        losses = [[getattr(e.loss, part) for e in run.events] for run in (found, expected)]
        assert_allclose(*losses, rtol=0, atol=tolerance * energy)
    assert abs(found.ledger.residual) <= 1e-10 * energy
    t = np.linspace(0, expected.t_end, 101)
    places = [run.displacement(t) for run in (found, expected)]
    assert_allclose(*places, rtol=0, atol=10 * tolerance * np.max(np.abs(places)))


def stopped(run):
    """Whether an impact has stopped all motion, of one mode say: signs after it are round-off in either loop."""
    velocities = [run.velocity(event.time) for event in run.events if event.impulse]
    mass = run.model.structure.mass
    return any(v @ mass @ v < 1e-20 * run.ledger.initial for v in velocities)


class TestRandomModels:
    @pytest.mark.parametrize("damping", DAMPINGS)
    @pytest.mark.parametrize("kind", KINDS)
    def test_agree(self, damping, kind):
        segments = left = compared = 0
        for seed in range(25):
            case = 1000 * KINDS.index(kind) + 100 * DAMPINGS.index(damping) + seed
            model, random = random_model(
                case, damping=damping, rigid_body=seed % 8 == 0, truncated=seed % 3 > 0, kind=kind
            )
            velocity = 2 * random.normal(size=model.structure.n)
            loads = [mp.ConstantLoad("m0", float(random.normal()))] if seed % 2 else ()
            expected, found = both(model, 1.5, velocity=velocity, loads=loads)
            segments, left = segments + len(found.segments), left + by_numpy(found)
            if not stopped(expected):
                compared += 1
                assert_same(expected, found, 1e-8)
        assert left < segments
        assert compared > 15


@pytest.mark.parametrize(
    "number",
    [
        30592,  # at rest on a rigid stop when a level begins in which no other mode moves it
        60230,  # two stops let go at nearly one instant, one of which has a twin
    ],
)
def test_random_cases_in_which_the_loops_once_differed(number):
    assert verdicts(number) == [("ok", "")]


class TestRig:
    @pytest.mark.parametrize("stiffness", [1e6, math.inf])
    @pytest.mark.parametrize("modes", [*range(1, 13), "all"])
    def test_agrees(self, stiffness, modes):
        model, start = rig(stiffness, modes, elements=57 if modes != "all" else 12)
        expected, found = both(model, 0.2, displacement=start)
        assert_same(expected, found, 1e-9)
        assert [segment.armed_at for segment in found.segments] == pytest.approx(
            [segment.armed_at for segment in expected.segments], abs=1e-9
        )
        if modes != "all":
            assert [s.phases for s in found.segments] == [s.phases for s in expected.segments]

    @pytest.mark.parametrize("stiffness", [1e6, math.inf])
    def test_agrees_loosely_over_a_second(self, stiffness):
        model, start = rig(stiffness, 6)
        expected, found = both(model, 1.0, displacement=start)
        assert_same(expected, found, 1e-6)

    @pytest.mark.parametrize("stiffness", [1e6, math.inf])
    @pytest.mark.parametrize("modes", [6, 8])
    def test_second_runs_stay_inside(self, stiffness, modes):
        model, start = rig(stiffness, modes)
        first, second = (mp.simulate(model, 1.0, displacement=start, compiled=True) for _ in range(2))
        assert by_numpy(second) == 0 < by_numpy(first)
        assert {Phase.RECOVERING, Phase.ARMED} <= {phase for s in second.segments for phase in s.phases}
        assert first.stats.function_evaluations > 10 * len(first.segments)

    def test_refused_contacts_and_rebounds_stay_inside(self):
        model, start = rig(math.inf, 12)
        mp.simulate(model, 0.5, displacement=start, compiled=True)
        run = mp.simulate(model, 0.5, displacement=start, compiled=True)
        left = by_numpy(run)
        assert left <= 2
        assert sum(segment.phases == (Phase.REFUSED,) for segment in run.segments) > left
        rebounds = [e for e, f in zip(run.events, run.events[1:], strict=False) if e.time == f.time]
        assert len(rebounds) > left
        assert all(event.kind == "close" and event.impulse > 0 for event in rebounds)

    def test_runs_repeat_bit_by_bit(self):
        model, start = rig(math.inf, 8)
        mp.simulate(model, 0.5, displacement=start, compiled=True)
        runs = [mp.simulate(model, 0.5, displacement=start, compiled=True) for _ in range(2)]
        assert runs[0].events == runs[1].events
        assert np.array_equal(runs[0].displacement(0.5), runs[1].displacement(0.5))

    def test_more_rows_than_at_first(self):
        model, start = rig(1e6, 6, damping=lambda: None)
        found = mp.simulate(model, 6.0, displacement=start, compiled=True)
        assert len(found.segments) > 256
        assert abs(found.ledger.residual) < 1e-10 * found.ledger.initial
        ends = [segment.end for segment in found.segments]
        assert [segment.start for segment in found.segments] == [0.0, *ends[:-1]]
        assert ends[-1] == found.t_end == 6.0


class TestHandBack:
    def test_contacts_that_close_together(self):
        structure = mp.LinearStructure(
            np.eye(3), [[900.0, -300, 0], [-300, 700, -300], [0, -300, 900.0]], points={"a": 0, "b": 2}
        )
        for stiffness in (math.inf, 1e5):
            contacts = [mp.UnilateralContact(name, name, 0.005, stiffness) for name in ("a", "b")]
            model = mp.MultiPhiModel(structure, contacts, "all")
            expected, found = both(model, 1.0, displacement=[0.02, 0.05, 0.02])
            assert by_numpy(found) > 2
            assert_same(expected, found, 1e-10)

    def test_a_contact_that_strikes_while_another_is_held(self):
        model = mp.MultiPhiModel(chain(3), [stop("m0", 0.05), stop("m2", 0.1, name="far")], modes="all")
        expected, found = both(model, 20.0, loads=[mp.ConstantLoad("m0", -1.0), mp.ConstantLoad("m2", -1.0)])
        assert any(len(segment.level.level.indices) == 2 for segment in expected.segments)
        assert_same(expected, found, 1e-8)

    def test_levels_with_powers_and_drives_and_without_modes(self):
        falling = mp.MultiPhiModel(mp.LinearStructure([[2.0]], [[0.0]], points={"m0": 0}), [stop(gap=5.0)], "all")
        expected, found = both(falling, 3.0, loads=[mp.ConstantLoad("m0", -20.0)])
        assert by_numpy(found) == len(found.segments) == 2
        assert_same(expected, found, 1e-12)
        pinned = oscillator(gap=-1.0, contact=math.inf)
        assert_same(*both(pinned, 5.0, displacement=[3.0]), 1e-12)

    def test_growing_motion(self):
        override = {(): mp.LevelOverride(None, [-0.1])}
        model = mp.MultiPhiModel(chain(2), [stop("m0", 0.5, 30.0)], "all", override)
        expected, found = both(model, 30.0, displacement=[0.1, 0.2])
        assert len(found.events) > 1
        assert [(e.contact, e.kind) for e in found.events] == [(e.contact, e.kind) for e in expected.events]
        assert_allclose([e.time for e in found.events], [e.time for e in expected.events], rtol=1e-10)


class TestFailures:
    def test_chatter_has_the_same_message(self, monkeypatch):
        monkeypatch.setattr(MOTION, "EVENTS_PER_PERIOD", 1.5)
        expected, found = both(oscillator(gap=0.0, contact=8.0), 1000.0, displacement=[1.0])
        assert "chatter: 200 events in" in found.message
        assert_same(expected, found, 1e-10)

    def test_chatter_that_the_numpy_loop_meets(self, monkeypatch):
        monkeypatch.setattr(MOTION, "EVENTS_PER_PERIOD", 0.5)
        walls = [stop("m0", 0.0, 8.0, "a"), stop("m0", 0.0, 8.0, "b")]
        structure = mp.LinearStructure([[2.0]], [[8.0]], points={"m0": 0})
        expected, found = both(mp.MultiPhiModel(structure, walls, "all"), 1000.0, displacement=[1.0])
        assert "chatter" in found.message
        assert by_numpy(found) == len(found.segments) > 200
        assert_same(expected, found, 1e-10)

    def test_no_motion_at_all(self):
        model = mp.MultiPhiModel(chain(2), [stop()], "all", {(): mp.LevelOverride([math.nan])})
        expected, found = both(model, 1.0, velocity=[1.0, 0.0])
        assert found.message == expected.message != ""
        assert found.events == ()

    def test_density_of_samples_changes_nothing(self):
        runs = []
        for refine in (1.0, 10.0):
            model, start = rig(1e6, 6)
            for closed in ((), ("support",)):
                model.level(closed).finder.refine = refine
            runs.append(mp.simulate(model, 0.3, displacement=start, compiled=True))
        assert [e.time for e in runs[0].events] == pytest.approx([e.time for e in runs[1].events], abs=1e-11)
        assert runs[1].stats.function_evaluations > 1.5 * runs[0].stats.function_evaluations


class TestBedOfStops:
    @staticmethod
    def struck(stiffness):
        """A model and its start: many stops are struck one after the other."""
        model = bed(stiffness, n=60, stops=12, modes=8)
        return model, model.level(()).shapes[:, :4] @ [-6.0, 5.0, -9.0, 4.0]

    @pytest.mark.parametrize("stiffness", [1e7, math.inf])
    def test_agrees(self, stiffness):
        model, velocity = self.struck(stiffness)
        expected, found = both(model, 0.03, velocity=velocity)
        assert_same(expected, found, 1e-8)
        assert len(found.events) > 15
        assert len({event.contact for event in found.events}) > 5
        again = mp.simulate(model, 0.03, velocity=velocity, compiled=True)
        assert by_numpy(again) < 0.5 * len(again.segments)

    def test_levels_that_have_no_room_are_left_to_the_numpy_loop(self, monkeypatch):
        model, velocity = self.struck(1e7)
        mp.simulate(model, 0.03, velocity=velocity, compiled=True)
        monkeypatch.setattr("multiphi_exudyn.time.compiled.pack.PACK_BYTES", 300_000)
        tight, _ = self.struck(1e7)
        runs = [mp.simulate(tight, 0.03, velocity=velocity, compiled=True) for _ in range(2)]
        assert 0 < by_numpy(runs[1]) < len(runs[1].segments)
        assert_same(mp.simulate(tight, 0.03, velocity=velocity, compiled=False), runs[1], 1e-8)
        packed = [m.rules.find(np.zeros(m.base.modes.count).tobytes()).compiled.bytes_packed for m in (model, tight)]
        assert 0 < packed[1] <= 300_000 < packed[0]


@pytest.mark.parametrize(("value", "risen"), [(0.0, True), (1e-3, True), (-1e-3, False)])
def test_only_what_starts_at_zero_or_above_rises(value, risen):
    """g = value + t: a straight line, whose bounds are those of its slope; below zero it has fallen already."""
    search = pytest.importorskip("multiphi_exudyn.time.compiled.search")
    left, right, bounds = np.array([value, 1.0]), np.array([value + 1, 1.0]), np.array([1.0, 1, 0, 0, 0, 0])
    line = (value, np.zeros((2, 1)), np.zeros((2, 1)), np.ones((2, 1)), 1)
    assert search.rises.py_func(left, right, 1.0, bounds, *line) is risen


@pytest.mark.parametrize(("value", "slope", "meets"), [(1e-13, -1.0, True), (1e-13, 1.0, False), (1e-9, -1.0, False)])
def test_a_second_signal_that_falls_through_zero_at_the_root_is_seen(value, slope, meets):
    """Two signals where the one exponential is 1: the first is at its root, the second ``value`` above zero."""
    search = pytest.importorskip("multiphi_exudyn.time.compiled.search")
    signals, slopes = np.zeros((2, 2, 1)), np.zeros((2, 2, 1))
    signals[1, 0, 0], slopes[1, 0, 0] = 1 + value, slope
    phi = np.array([[1.0], [0.0]])
    assert search.meets_another.py_func(0, signals, slopes, np.array([0.0, -1.0]), 2, phi, 1) is meets


class TestWithoutNumba:
    @pytest.fixture(autouse=True)
    @staticmethod
    def missing(monkeypatch):
        for name in [name for name in sys.modules if name.startswith("multiphi_exudyn.time.compiled")]:
            monkeypatch.delitem(sys.modules, name)
        monkeypatch.setitem(sys.modules, "numba", None)

    def test_the_numpy_loop_runs(self):
        run = mp.simulate(oscillator(), 1.0, velocity=[-3.0])
        assert isinstance(run.segments, tuple)
        assert len(run.events) == 2

    def test_the_compiled_one_is_refused(self):
        with pytest.raises(MultiPhiError, match="need it: pip install numba"):
            mp.simulate(oscillator(), 1.0, compiled=True)


def test_no_place_for_a_cache_only_costs_time(monkeypatch):
    caching = pytest.importorskip("numba.core.caching")
    monkeypatch.setattr(caching.CompileResultCacheImpl, "_locator_classes", [])
    waves = importlib.import_module("multiphi_exudyn.time.compiled.waves")

    def doubled(x):
        return 2 * x

    assert waves.cached(doubled)(3.5) == 7.0


def test_numba_is_loaded_by_the_first_run_alone():
    code = (
        "import sys, multiphi_exudyn as mp; loaded = 'numba' in sys.modules;"
        "m = mp.MultiPhiModel(mp.LinearStructure([[2.0]], [[8.0]]), [], 'all');"
        "mp.simulate(m, 1.0, compiled=False); loaded |= 'numba' in sys.modules; print(loaded)"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "False"


class TestLazyResults:
    @pytest.fixture(scope="class")
    @classmethod
    def run(cls):
        model, start = rig(1e6, 4)
        return mp.simulate(model, 0.5, displacement=start, compiled=True)

    def test_are_sequences(self, run):
        for found in (run.segments, run.events):
            assert found[0] is found[0]
            assert found[-1] == found[len(found) - 1] == list(found)[-1]
            assert found[1:3] == (found[1], found[2])
            assert found == tuple(found)
            assert found != found[1:]
            with pytest.raises(IndexError):
                found[len(found)]

    def test_are_plain_numbers(self, run):
        event, segment = run.events[1], run.segments[1]
        assert type(event.time) is type(event.impulse) is type(event.loss.impact) is float
        assert type(segment.start) is type(segment.end) is type(segment.armed_at) is float
        assert segment.coefficients.dtype == complex
