"""The size of a motion, which the loop looks at on its way where truncation takes much, and nobody else then has to."""

import math

import numpy as np
import pytest
from small_structures import chain, stop

import multiphi_exudyn as mp
from multiphi_exudyn.time.record import Record
from multiphi_exudyn.time.simulate import Run

pytestmark = pytest.mark.filterwarnings("ignore::multiphi_exudyn.MultiPhiWarning")

END = 0.5
BENT = 3e-3 * np.arange(18.0)
TIMES = np.linspace(0.0, END, 301)
LOADS = {
    "free": (),
    "static": (mp.ConstantLoad("m9", 2.0),),
    "harmonic": (mp.HarmonicLoad("m9", 5.0, 12.0),),
    "samples": (mp.SampledLoad("m9", TIMES, 5.0 * np.sin(80.0 * TIMES)),),
}


def model(modes, stiffness=1e6):
    structure = chain(18, mass=0.5, stiffness=2e4, damping=mp.ModalDamping(0.02))
    return mp.MultiPhiModel(structure, [stop("m17", 5e-3, stiffness)], modes=modes)


def runs(given, count=2, **options):
    """The same run several times."""
    found = [mp.simulate(given, END, displacement=BENT, **options) for _ in range(count)]
    assert {run.status for run in found} == {"ok"}
    return found


def sizes(run):
    """What the loop has seen of a run, its energy where a load acts; None where it has not seen all."""
    seen = run.ending.record.trajectory.truncation
    if math.isnan(seen.mean_square):
        return None
    return seen.mean_square, 0.0 if seen.is_isolated else seen.largest_energy


def recorded(run, end):
    """The same from the record."""
    square, energy = run.segments.sizes(end)
    return square, 0.0 if run.ending.record.trajectory.truncation.is_isolated else energy


@pytest.mark.parametrize("stiffness", [1e6, math.inf])
@pytest.mark.parametrize("loads", LOADS)
def test_what_the_loop_sees_is_what_the_record_tells(loads, stiffness):
    first, second = runs(model(4, stiffness), loads=LOADS[loads])
    for run in (first, second):
        assert sizes(run) == pytest.approx(recorded(run, END), rel=1e-9)
    assert first.warnings == second.warnings
    assert any(sentence.startswith("truncation:") for sentence in second.warnings)


def test_a_run_that_tells_of_its_truncation_is_not_sampled_again(monkeypatch):
    calls, asked = [], Record.sizes
    monkeypatch.setattr(Record, "sizes", lambda *given: calls.append(1) or asked(*given))
    told = [run.warnings for run in runs(model(4), count=3)]
    assert calls == []
    assert len(set(told)) == 1


def test_a_run_that_tells_of_its_energy_alone_is_not_sampled_where_it_begins_with_the_most(monkeypatch):
    """Nothing works on it, so its largest energy is that of its start; under a load that has to be looked for."""
    structure = chain(40, mass=0.5, stiffness=2e4, damping=mp.ModalDamping(0.02))
    given = mp.MultiPhiModel(structure, [stop("m39", 5e-3, 2e4)], modes=37)
    x, v = 1e-3 * np.arange(40.0), 0.03 * (-1.0) ** np.arange(40)  # that shape is in no mode of the 37
    calls, asked = [], Record.sizes
    monkeypatch.setattr(Record, "sizes", lambda *given: calls.append(1) or asked(*given))
    alone = mp.simulate(given, END, displacement=x, velocity=v)
    many = mp.simulate_many(given, END, [x, x], [v, v])
    assert calls == []
    loaded = mp.simulate(given, END, displacement=x, velocity=v, loads=LOADS["static"])
    assert calls == [1]
    for told in (alone.warnings, *many.warnings, loaded.warnings):
        assert [sentence.partition(":")[0] for sentence in told] == ["lost energy"]


def test_a_run_that_loses_little_is_not_looked_at_beyond_its_first_decision():
    run = runs(model(17, stiffness=2e4), count=1)[0]
    assert run.warnings == ()
    assert len(run.events) > 2
    assert sizes(run) is None


def test_a_motion_that_meets_nothing_is_not_looked_at():
    run = mp.simulate(model(17, stiffness=2e4), 1e-5, displacement=BENT)
    assert len(run.events) == 0
    assert sizes(run) is None


def test_a_run_that_goes_on_is_looked_at_from_there():
    given = model(4)
    first = runs(given)[-1]
    for loads in LOADS.values():
        run = mp.simulate(given, 1.7 * END, start=first, loads=loads)
        assert sizes(run) == pytest.approx(recorded(run, 1.7 * END), rel=1e-9)


def test_a_run_without_displacement_at_its_start_is_looked_at():
    run = mp.simulate(model(4), END, velocity=40 * BENT)
    assert sizes(run) == pytest.approx(recorded(run, END), rel=1e-9)


def test_a_motion_carried_in_steps_is_not_taken_for_one_that_was_looked_at():
    """The loop knows the end it is given first; what comes after that is sampled."""
    given = model(4)
    whole = runs(given)[-1]
    motion = Run(given, END, BENT).begun()
    for end in (0.1 * END, 0.4 * END, END):
        motion.advance(end)
    run = motion.trajectory(END)
    assert sizes(run) is None
    assert recorded(run, END) == pytest.approx(sizes(whole), rel=1e-9)
    again = Run(given, END, BENT).begun()
    again.continue_from(whole.final, END)
    again.advance(1.5 * END)
    assert sizes(again.trajectory(1.5 * END)) is None


def test_many_runs_are_looked_at_as_each_alone():
    given, starts = model(4), np.outer(np.linspace(0.8, 1.2, 8), BENT)
    alone = [mp.simulate(given, END, displacement=x).warnings for x in starts]
    assert mp.simulate_many(model(4), END, starts).warnings == tuple(alone)
    assert all(any(sentence.startswith("truncation:") for sentence in told) for told in alone)
