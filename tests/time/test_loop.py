"""Compiled, the loop gives what it gives as plain Python: events, phases, losses and messages; and how it is called."""

import math
import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_structures import bed, chain, oscillator, random_model, stop

import multiphi_exudyn as mp
from multiphi_exudyn.errors import MultiPhiError
from multiphi_exudyn.events.packing import level_arrays
from multiphi_exudyn.events.transitions.state import Phase
from multiphi_exudyn.mathematics.compiling import compiled
from multiphi_exudyn.mathematics.compiling.compiled import entry
from multiphi_exudyn.time.loop import chatter
from multiphi_exudyn.time.loop.loop import advance
from multiphi_exudyn.time.reliability.run_warnings import warnings_of
from multiphi_exudyn.time.run import motion
from multiphi_exudyn.time.simulate import Run, simulate
from reference_models.rig import rig_beam, rig_contact, rig_damping

DAMPINGS = ("none", "modal", "rayleigh", "given")
KINDS = ("mixed", "rigid", "compliant")


def rig(stiffness, modes, elements=57, damping=rig_damping):
    structure = mp.planar_beam(rig_beam(), elements=elements, damping=damping())
    model = mp.MultiPhiModel(structure, [rig_contact(stiffness)], modes=modes)
    unit = model.static_equilibrium({"node3": 1e-3})
    return model, unit * 0.020 / float(structure.row("node3") @ unit)


def both(model, t_end, **given):
    return tuple(mp.simulate(model, t_end, compiled=choice, **given) for choice in (False, True))


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
    """Whether an impact has stopped all motion, of one mode say: signs after it are round-off."""
    velocities = [run.velocity(event.time) for event in run.events if event.impulse]
    mass = run.model.structure.mass
    return any(v @ mass @ v < 1e-20 * run.ledger.initial for v in velocities)


class TestRandomModels:
    @pytest.mark.parametrize("damping", DAMPINGS)
    @pytest.mark.parametrize("kind", KINDS)
    def test_agree(self, damping, kind):
        compared = 0
        for seed in range(9):
            case = 1000 * KINDS.index(kind) + 100 * DAMPINGS.index(damping) + seed
            model, random = random_model(
                case, damping=damping, rigid_body=seed % 8 == 0, truncated=seed % 3 > 0, kind=kind
            )
            velocity = 2 * random.normal(size=model.structure.n)
            loads = [mp.ConstantLoad("m0", float(random.normal()))] if seed % 2 else ()
            expected, found = both(model, 1.5, velocity=velocity, loads=loads)
            if not stopped(expected):
                compared += 1
                assert_same(expected, found, 1e-8)
        assert compared > 5


class TestRig:
    @pytest.mark.parametrize("stiffness", [1e6, math.inf])
    @pytest.mark.parametrize("modes", [1, 3, 6, 12, "all"])
    def test_agrees(self, stiffness, modes):
        model, start = rig(stiffness, modes, elements=57 if modes != "all" else 8)
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

    @pytest.mark.parametrize("modes", [8, 12])
    def test_contacts_recover_and_are_refused(self, modes):
        model, start = rig(math.inf, modes)
        run = mp.simulate(model, 0.5, displacement=start, compiled=True)
        assert {Phase.RECOVERING, Phase.REFUSED} & {phase for s in run.segments for phase in s.phases}
        assert run.stats.function_evaluations > 10 * len(run.segments)

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


class TestSeveralContacts:
    def test_contacts_that_close_together(self):
        structure = mp.LinearStructure(
            np.eye(3), [[900.0, -300, 0], [-300, 700, -300], [0, -300, 900.0]], points={"a": 0, "b": 2}
        )
        for stiffness in (math.inf, 1e5):
            contacts = [mp.UnilateralContact(name, name, 0.005, stiffness) for name in ("a", "b")]
            model = mp.MultiPhiModel(structure, contacts, "all")
            expected, found = both(model, 1.0, displacement=[0.02, 0.05, 0.02])
            assert_same(expected, found, 1e-10)

    def test_a_contact_that_strikes_while_another_is_held(self):
        model = mp.MultiPhiModel(chain(3), [stop("m0", 0.05), stop("m2", 0.1, name="far")], modes="all")
        expected, found = both(model, 20.0, loads=[mp.ConstantLoad("m0", -1.0), mp.ConstantLoad("m2", -1.0)])
        assert any(len(segment.level.level.indices) == 2 for segment in expected.segments)
        assert_same(expected, found, 1e-8)

    def test_levels_with_powers_and_drives_and_without_modes(self):
        falling = mp.MultiPhiModel(mp.LinearStructure([[2.0]], [[0.0]], points={"m0": 0}), [stop(gap=5.0)], "all")
        expected, found = both(falling, 3.0, loads=[mp.ConstantLoad("m0", -20.0)])
        assert len(found.segments) == 2
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
        monkeypatch.setattr(chatter, "EVENTS_PER_PERIOD", 1.5)
        expected, found = both(oscillator(gap=0.0, contact=8.0), 1000.0, displacement=[1.0])
        assert "chatter: 200 events in" in found.message
        assert_same(expected, found, 1e-10)

    def test_chatter_of_two_contacts_at_one_place(self, monkeypatch):
        monkeypatch.setattr(chatter, "EVENTS_PER_PERIOD", 0.5)
        walls = [stop("m0", 0.0, 8.0, "a"), stop("m0", 0.0, 8.0, "b")]
        structure = mp.LinearStructure([[2.0]], [[8.0]], points={"m0": 0})
        expected, found = both(mp.MultiPhiModel(structure, walls, "all"), 1000.0, displacement=[1.0])
        assert "chatter" in found.message
        assert len(found.segments) > 200
        assert_same(expected, found, 1e-10)

    def test_no_motion_at_all(self):
        model = mp.MultiPhiModel(chain(2), [stop()], "all", {(): mp.LevelOverride([math.nan])})
        expected, found = both(model, 1.0, velocity=[1.0, 0.0])
        assert found.message == expected.message != ""
        assert found.events == ()


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

    def test_arrays_that_become_too_large_begin_anew(self, monkeypatch):
        model, velocity = self.struck(1e7)
        expected = mp.simulate(model, 0.03, velocity=velocity, compiled=True)
        monkeypatch.setattr(level_arrays, "ARRAY_BYTES", 600_000)
        tight, _ = self.struck(1e7)
        found = mp.simulate(tight, 0.03, velocity=velocity, compiled=True)
        assert_same(expected, found, 1e-12)
        packed = [1 + max(rules_of(m).arrays.loaded) for m in (model, tight)]  # as they are numbered
        assert packed[1] > packed[0]


def rules_of(model):
    """What a model keeps of its runs without loads."""
    return model.loaded.find((np.zeros(model.base.modes.count).tobytes(), math.inf))


def test_runs_of_one_model_may_take_turns():
    model, start = rig(1e6, 6)
    alone = mp.simulate(model, 0.4, displacement=start)
    runs = [Run(model, 0.4, factor * start).begun() for factor in (1.0, 0.5)]
    for end in (0.1, 0.2, 0.3, 0.4):
        for run in runs:
            run.advance(end)
    found = runs[0].trajectory(0.4)
    assert [e.time for e in found.events] == pytest.approx([e.time for e in alone.events], abs=1e-9)
    assert_allclose(found.displacement(0.4), alone.displacement(0.4), atol=1e-9)


def test_a_run_whose_arrays_were_lent_to_a_question_goes_on_as_if_they_had_not_been():
    """Sums of the run, its chatter check and its channels stand there again, to the bit."""
    model, start = rig(1e6, 6)
    load = [mp.HarmonicLoad("node3", 0.5, 30.0)]
    whole, other = (Run(model, 0.4, start, None, load).begun() for _ in range(2))
    for end in (0.1, 0.2, 0.3, 0.4):
        whole.advance(end)
        other.advance(end)
        assert other.trajectory(end).segments.sizes(end)[0] > 0
    found, expected = other.trajectory(0.4), whole.trajectory(0.4)
    assert np.array_equal(found.events.table(), expected.events.table())
    assert (found.segments.defects, found.segments.truncated) == (
        expected.segments.defects,
        expected.segments.truncated,
    )
    assert found.ledger == expected.ledger


def calls_of(asked):
    """How many functions of Python are called."""
    calls = []
    sys.setprofile(lambda frame, event, _: calls.append(frame.f_code.co_name) if event == "call" else None)
    try:
        asked()
    finally:
        sys.setprofile(None)
    return len(calls)


def test_a_warm_run_without_events_is_made_by_few_calls():
    """What does not hang on the start is prepared once; each call costs a warm run a three-hundredth."""
    model, start = rig(1e6, 6)
    rest = model.equilibrium({"node3": 1.0})
    for given in ({"displacement": start}, {"start": rest}):
        mp.simulate(model, 1e-3, **given)
        assert calls_of(lambda given=given: mp.simulate(model, 1e-3, **given)) < 73


@pytest.mark.filterwarnings("ignore::multiphi_exudyn.MultiPhiWarning")
def test_warnings_and_the_ledger_of_a_warm_run_take_few_calls():
    """The loop has judged what truncation took, and summed the works; runs that are told alike are told once.

    Only how far a level rests from where it moved is asked of every run.
    """
    model, start = rig(1e6, 6)
    for _ in range(3):
        run = mp.simulate(model, 1.0, displacement=start)
        assert run.ledger.final > 0  # what it is read from is packed
    assert len(run.warnings) == 2
    assert calls_of(lambda: warnings_of(run)) < 11
    assert calls_of(lambda: run.ledger) < 14


def test_a_run_stops_at_its_next_event_if_asked():
    model, start = rig(1e6, 6)
    whole = mp.simulate(model, 0.2, displacement=start)
    motion = Run(model, 0.2, start).begun()
    for event in whole.events[:5]:
        motion.advance(0.2, to_change=True)
        assert motion.time == event.time
    motion.advance(0.2)
    assert len(motion.trajectory(0.2).events) == len(whole.events)


class TestWithoutNumba:
    @pytest.fixture(autouse=True)
    @staticmethod
    def missing(monkeypatch):
        monkeypatch.setattr(motion, "carry", entry(advance))
        for name in (f"{compiled.__name__}.available", f"{simulate.__module__}.available"):
            monkeypatch.setattr(name, lambda: False)

    def test_the_loop_runs_as_plain_python(self):
        run = mp.simulate(oscillator(), 1.0, velocity=[-3.0])
        assert motion.carry.native() is motion.carry.plain
        assert len(run.events) == 2

    def test_the_compiled_one_is_refused(self):
        with pytest.raises(MultiPhiError, match="need it: pip install numba"):
            mp.simulate(oscillator(), 1.0, compiled=True)


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
        assert segment.flow.coefficients.dtype == complex
