"""The loop of a run: runs repeat, stop and take turns; chatter and failures have their messages; results are lazy."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_structures import chain, oscillator, stop

import multiphi_exudyn as mp
from multiphi_exudyn.time import motion as chatter
from multiphi_exudyn.time.simulate import Run
from multiphi_exudyn.time.state import Phase
from reference_models.rig import rig_beam, rig_contact, rig_damping


def rig(stiffness, modes, elements=57, damping=rig_damping):
    structure = mp.planar_beam(rig_beam(), elements=elements, damping=damping())
    model = mp.MultiPhiModel(structure, [rig_contact(stiffness)], modes=modes)
    unit = model.static_equilibrium({"node3": 1e-3})
    return model, unit * 0.020 / float(structure.row("node3") @ unit)


class TestRig:
    @pytest.mark.parametrize("modes", [8, 12])
    def test_contacts_recover_and_are_refused(self, modes):
        model, start = rig(math.inf, modes)
        run = mp.simulate(model, 0.5, displacement=start)
        assert {Phase.RECOVERING, Phase.REFUSED} & {phase for s in run.segments for phase in s.phases}
        assert run.stats.function_evaluations > 5 * len(run.segments)

    def test_runs_repeat_bit_by_bit(self):
        model, start = rig(math.inf, 8)
        runs = [mp.simulate(model, 0.5, displacement=start) for _ in range(3)]
        assert runs[0].events == runs[1].events == runs[2].events
        assert np.array_equal(runs[0].displacement(0.5), runs[2].displacement(0.5))


def test_levels_with_powers_of_time_and_without_modes():
    """It falls 5 m onto a rigid stop, and rests there."""
    falling = mp.MultiPhiModel(mp.LinearStructure([[2.0]], [[0.0]], points={"m0": 0}), [stop(gap=5.0)], "all")
    found = mp.simulate(falling, 3.0, loads=[mp.ConstantLoad("m0", -20.0)])
    assert len(found.segments) == 2
    assert found.events[0].time == pytest.approx(1.0, rel=1e-14)
    assert found.at("m0", 3.0) == pytest.approx(-5.0, rel=1e-14)


def test_growing_motion():
    override = {(): mp.LevelOverride(None, [-0.1])}
    model = mp.MultiPhiModel(chain(2), [stop("m0", 0.5, 30.0)], "all", override)
    found = mp.simulate(model, 30.0, displacement=[0.1, 0.2])
    assert len(found.events) > 1
    assert found.ledger.final > found.ledger.initial
    assert abs(found.ledger.residual) < 1e-10 * found.ledger.final


class TestFailures:
    def test_chatter_has_its_message(self, monkeypatch):
        monkeypatch.setattr(chatter, "EVENTS_PER_PERIOD", 1.5)
        found = mp.simulate(oscillator(gap=0.0, contact=8.0), 1000.0, displacement=[1.0])
        assert found.status == "failed"
        assert "chatter: 200 events in" in found.message

    def test_no_motion_at_all(self):
        model = mp.MultiPhiModel(chain(2), [stop()], "all", {(): mp.LevelOverride([math.nan])})
        found = mp.simulate(model, 1.0, velocity=[1.0, 0.0])
        assert found.message != ""
        assert found.events == ()


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


def test_a_run_that_is_asked_on_its_way_goes_on_as_if_it_had_not_been():
    """To the bit."""
    model, start = rig(1e6, 6)
    load = [mp.HarmonicLoad("node3", 0.5, 30.0)]
    whole, other = (Run(model, 0.4, start, None, load).begun() for _ in range(2))
    for end in (0.1, 0.2, 0.3, 0.4):
        whole.advance(end)
        other.advance(end)
        assert other.trajectory(end).segments.sizes(end)[0] > 0
    found, expected = other.trajectory(0.4), whole.trajectory(0.4)
    assert np.array_equal(found.events.table(), expected.events.table())
    assert (found.segments.truncation.defects, found.segments.truncation.truncated_energy) == (
        expected.segments.truncation.defects,
        expected.segments.truncation.truncated_energy,
    )
    assert found.ledger == expected.ledger


def test_a_run_stops_at_its_next_event_if_asked():
    model, start = rig(1e6, 6)
    whole = mp.simulate(model, 0.2, displacement=start)
    motion = Run(model, 0.2, start).begun()
    for event in whole.events[:5]:
        motion.advance(0.2, to_change=True)
        assert motion.time == event.time
    motion.advance(0.2)
    assert len(motion.trajectory(0.2).events) == len(whole.events)


class TestLazyResults:
    @pytest.fixture(scope="class")
    @classmethod
    def run(cls):
        model, start = rig(1e6, 4)
        return mp.simulate(model, 0.5, displacement=start)

    def test_are_sequences(self, run):
        events, segments = run.events, run.segments
        assert events[-1] == events[len(events) - 1] == list(events)[-1]
        assert events[1:3] == (events[1], events[2])
        assert events == tuple(events) != events[1:]
        assert [each.start for each in segments[1:3]] == [segments[1].start, segments[2].start]
        assert segments[-1].end == list(segments)[-1].end == run.t_end
        for found in (events, segments):
            with pytest.raises(IndexError):
                found[len(found)]
