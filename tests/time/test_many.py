"""Many runs at once are each what they are alone, to the bit, however many threads there are."""

import math
import threading

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from small_structures import bed, chain, stop

import multiphi_exudyn as mp
import multiphi_exudyn._core as core
from multiphi_exudyn.time import many as workers
from multiphi_exudyn.time import motion as chatter
from multiphi_exudyn.time.model_warnings import kept_back
from multiphi_exudyn.time.motion import Motion

END = 6.0
TIMES = np.linspace(0, END, 13)


def model(modes=4, **contact):
    stops = [stop("m5", 0.1, **contact), stop({"m2": -1.0}, 0.12, 40.0, name="above")]
    return mp.MultiPhiModel(chain(6, damping=mp.RayleighDamping(0.02, 0.01), stiffness=30.0), stops, modes=modes)


def starts(count, seed=0, n=6, most=0.35):
    """Displacements, some of them inside the upper stop; up to 0.11 m all of them are clear of it."""
    return np.random.default_rng(seed).uniform(-0.09, most, (count, n))


def alone(given, starts, **options):
    """What ``simulate_many`` keeps, from runs one by one of a model that has built nothing."""
    runs = []
    for x in starts:
        with kept_back():
            runs.append(mp.simulate(given, END, displacement=x, **options))
    return runs


def check(found, runs, points):
    assert found.status == tuple(run.status for run in runs)
    assert found.messages == tuple(run.message for run in runs)
    assert found.warnings == tuple(run.warnings for run in runs)
    assert_array_equal(found.events, [len(run.events) for run in runs])
    assert_array_equal(found.ends, [run.t_end for run in runs])
    for k, run in enumerate(runs):
        for p, point in enumerate(points):
            assert_array_equal(found.samples[k, p], run.at(point, TIMES))


LOADS = {
    "none": (),
    "constant": (mp.ConstantLoad("m3", 0.2),),
    "harmonic": (mp.HarmonicLoad("m1", 0.3, 0.2),),
    "function": (mp.FunctionLoad("m1", lambda t: 0.1 * np.sin(t)),),
    "sampled": (mp.SampledLoad("m1", np.array([0.0, 1.0, 2.5, 9.0]), np.array([0.0, 0.3, -0.2, 0.4])),),
}


@pytest.mark.filterwarnings("ignore::multiphi_exudyn.MultiPhiWarning")
@pytest.mark.parametrize(
    ("stiffness", "loads", "count"),
    [
        (50.0, "none", 17),
        (50.0, "harmonic", 17),
        (50.0, "sampled", 17),
        (math.inf, "constant", 17),
        (math.inf, "function", 5),
    ],
)
def test_are_those_of_simulate_to_the_bit(loads, stiffness, count):
    """The first one is run alone, as are all under functions; the others in batches."""
    points = ("m5", {"m0": 1.0, "m2": -2.0}, np.eye(6)[4])
    given, x = LOADS[loads], starts(count)
    runs = alone(model(stiffness=stiffness), x, loads=given)
    assert sum(len(run.events) for run in runs) > 12
    for threads in (1, 3):
        found = mp.simulate_many(
            model(stiffness=stiffness), END, x, loads=given, points=points, times=TIMES, threads=threads
        )
        check(found, runs, points)


@pytest.mark.filterwarnings("ignore::multiphi_exudyn.MultiPhiWarning")
def test_many_levels_are_built_once_for_all():
    stops, random = bed(1e5, n=60, stops=20), np.random.default_rng(1)
    shapes = stops.level(()).shapes[:, :4]
    velocities = (shapes @ random.normal(size=(4, 8))).T
    found = mp.simulate_many(stops, 0.02, velocities=velocities, threads=4)
    built = stops.levels_built
    assert built > 20
    mp.simulate_many(stops, 0.02, velocities=velocities[::-1], threads=2)
    assert stops.levels_built == built
    assert found.samples.shape == (8, 0, 1)
    assert np.sum(found.events) > 50


@pytest.mark.filterwarnings("ignore::multiphi_exudyn.MultiPhiWarning")
def test_a_tolerance_is_decided_by_the_first_run():
    first, second = model(mp.Tolerance(0.02)), model(mp.Tolerance(0.02))
    runs = alone(first, starts(4))
    check(mp.simulate_many(second, END, starts(4), points=["m5"], times=TIMES, threads=3), runs, ["m5"])
    assert second.decided.modes == first.decided.modes


def test_there_are_as_many_threads_as_cores(monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 3)
    threads, run_batch = [], core.run_batch
    monkeypatch.setattr(core, "run_batch", lambda *given: threads.append(given[-1]) or run_batch(*given))
    mp.simulate_many(model("all"), END, starts(4))
    assert threads == [3]


@pytest.mark.filterwarnings("ignore::multiphi_exudyn.MultiPhiWarning")
class TestSeveralRunsTogether:
    """Carried by one call of the loop, they are what each of them is alone."""

    @pytest.fixture
    def calls(self, monkeypatch):
        """Of every batch, how many runs came to their ends."""
        together, run_batch = [], core.run_batch

        def counted(*given):
            runs = run_batch(*given)
            together.append(sum(run.is_complete for run in runs))
            return runs

        monkeypatch.setattr(core, "run_batch", counted)
        return together

    @pytest.mark.parametrize("loads", ["none", "harmonic"])
    @pytest.mark.parametrize(("modes", "stiffness"), [(4, 50.0), (3, math.inf), ("all", 50.0)])
    def test_to_the_bit(self, modes, stiffness, loads, calls):
        points = ("m5", {"m0": 1.0, "m2": -2.0})
        given, x = LOADS[loads], starts(24, most=0.11)
        runs = alone(model(modes, stiffness=stiffness), x, loads=given)
        for threads in (1, 2):
            found = mp.simulate_many(
                model(modes, stiffness=stiffness), END, x, loads=given, points=points, times=TIMES, threads=threads
            )
            check(found, runs, points)
        assert sum(calls) > 20

    @pytest.mark.parametrize("threads", [1, 3])
    def test_in_few_batches(self, threads, calls):
        mp.simulate_many(model("all"), END, starts(200, most=0.11), threads=threads)
        assert sum(calls) == 199
        assert len(calls) <= 199 // (workers.BATCH * threads) + 1

    def test_one_that_stops_is_carried_by_itself(self, calls):
        """Inside a stop, or not finite, at its start; others go on together."""
        x = starts(30, most=0.11)
        x[5, 5], x[11, 0], x[17, 2] = -0.2, math.nan, 0.3
        x[23] = 0.0
        runs = alone(model("all", stiffness=50.0), np.delete(x, 11, axis=0))
        found = mp.simulate_many(model("all", stiffness=50.0), END, x, points=["m5"], times=TIMES, threads=1)
        assert found.status == ("ok",) * 11 + ("failed",) + ("ok",) * 18
        assert_array_equal(np.delete(found.events, 11), [len(run.events) for run in runs])
        assert_array_equal(np.delete(found.samples[:, 0], 11, axis=0), [run.at("m5", TIMES) for run in runs])
        assert sum(calls) > 15

    def test_one_pressed_against_a_rigid_contact_at_its_start(self, calls):
        """Its numbers do not tell what its first level leaves out of it; the run as a whole does."""
        x, loads = starts(32, most=0.11), [mp.ConstantLoad("m5", -9.0)]
        x[::2], x[::2, 5] = np.linspace(0, -0.1, 6), -0.1
        runs = alone(model(3), x, loads=loads)
        check(mp.simulate_many(model(3), END, x, loads=loads, points=["m5"], times=TIMES, threads=1), runs, ["m5"])
        assert sum(calls) > 15

    def test_decisions_of_one_run_are_no_chatter_of_the_next(self, monkeypatch, calls):
        """A window of the check that reached back into another run would have no time in it."""
        monkeypatch.setattr(chatter, "CHATTER_WINDOW", 1)
        found = mp.simulate_many(model("all", stiffness=50.0), END, starts(5), threads=1)
        assert found.status == ("ok",) * 5
        assert calls == [4]
        assert np.all(found.events > 2)

    def test_with_friction(self, calls):
        """States, held places and warnings of friction are of each run."""
        x, given = np.random.default_rng(3).uniform(-0.3, 0.3, (30, 6)), []
        for _ in range(2):
            ring = mp.Friction("ring", "m3", limit=0.4)
            structure = chain(6, damping=mp.RayleighDamping(0.02, 0.01), stiffness=30.0)
            given.append(mp.MultiPhiModel(structure, [stop("m5", 0.1), ring], modes=4))
        x[:, 5] = np.abs(x[:, 5])
        runs = alone(given[0], x)
        check(mp.simulate_many(given[1], END, x, points=["m5"], times=TIMES, threads=2), runs, ["m5"])
        assert sum(len(run.events) for run in runs) > 100

    def test_motions_are_whole(self, monkeypatch):
        """A run of a batch is that of a run alone: its segments, events, final state, energies and statistics."""
        own, found_all, ended = model(4, stiffness=50.0), [], Motion.ended
        monkeypatch.setattr(workers.Motion, "ended", lambda *given: found_all.append(ended(*given)) or found_all[-1])
        with kept_back():
            runs = [mp.simulate(own, END, displacement=x) for x in starts(4, most=0.11)]
            mp.simulate_many(own, END, starts(4, most=0.11), threads=2)
        assert len(found_all) == 3
        for motion, run in zip(found_all, runs[1:], strict=True):
            found = motion.trajectory(END)
            assert [(s.start, s.end, s.phases) for s in found.segments] == [
                (s.start, s.end, s.phases) for s in run.segments
            ]
            assert list(found.events) == list(run.events)
            assert found.ledger == run.ledger
            assert found.start_loss == run.start_loss
            assert_array_equal(found.final.displacement, run.final.displacement)
            assert_array_equal(found.final.velocity, run.final.velocity)
            assert found.final.phases == run.final.phases
            work = (found.stats.transitions, found.stats.segments, found.stats.function_evaluations)
            assert work == (run.stats.transitions, run.stats.segments, run.stats.function_evaluations)


class TestARunThatFails:
    def test_is_a_status_of_its_row(self, monkeypatch):
        """Refused, inside a rigid stop; not finite; and failed on the way, by chatter that is looked for too early."""
        x = starts(5)
        x[1, 5], x[3, 0] = -1.0, math.nan
        found = mp.simulate_many(model("all"), END, x, points=["m5"], times=TIMES, threads=2)
        assert found.status == ("ok", "failed", "ok", "failed", "ok")
        assert "inside the rigid contact" in found.messages[1]
        assert "NaN" in found.messages[3]
        assert np.all(np.isnan(found.samples[[1, 3]]))
        assert np.all(np.isfinite(found.samples[[0, 2, 4]]))
        monkeypatch.setattr("multiphi_exudyn.time.motion.limits", lambda model: (2, 1e-3))
        found = mp.simulate_many(model("all"), END, x[:1], points=["m5"], times=TIMES)
        assert found.status == ("failed",)
        assert "chatter" in found.messages[0]
        assert 0 < found.ends[0] < END
        assert_array_equal(np.isnan(found.samples[0, 0]), found.ends[0] < TIMES)

    def test_warnings_are_issued_by_their_kinds(self):
        with pytest.warns(mp.MultiPhiWarning, match="truncated contact: 3 of 3 runs") as issued:
            mp.simulate_many(model(2, stiffness=50.0), END, starts(3))
        kinds = [str(one.message).partition(":")[0] for one in issued]
        assert len(kinds) == len(set(kinds))


def test_an_error_that_is_nobodys_ends_all(monkeypatch):
    def broken(*_):
        raise RuntimeError("a fault of the program")

    monkeypatch.setattr(core, "run_batch", broken)
    with pytest.raises(RuntimeError, match="a fault of the program"):
        mp.simulate_many(model("all"), END, starts(50), threads=2)


@pytest.mark.parametrize(
    ("kind", "changes", "begins"),
    [
        (TypeError, {"displacements": None}, "displacements: got None, and no velocities"),
        (ValueError, {"displacements": np.zeros(6)}, "displacements: got shape (6,)"),
        (ValueError, {"displacements": np.zeros((0, 6))}, "displacements: got shape (0, 6)"),
        (ValueError, {"velocities": np.zeros((2, 6))}, "velocities: got shape (2, 6)"),
        (ValueError, {"points": ["m9"]}, "point: got 'm9'"),
        (TypeError, {"points": "m0"}, "points: got 'm0', need a sequence"),
        (ValueError, {"loads": [mp.ConstantLoad("m9", 1.0)]}, "point: got 'm9'"),
        (TypeError, {"loads": mp.ConstantLoad("m1", 1.0)}, "loads: got ConstantLoad"),
        (ValueError, {"times": [0.0, 7.0], "points": ["m0"]}, "times: got"),
        (ValueError, {"threads": 0}, "threads: got 0"),
        (TypeError, {"threads": 2.0}, "threads: got 2.0"),
        (TypeError, {"model": None}, "model: got NoneType"),
        (ValueError, {"t_end": -1.0}, "t_end: got -1.0"),
    ],
)
def test_bad_input_is_refused(refused, kind, changes, begins):
    given = {"model": model("all"), "t_end": END, "displacements": np.zeros((3, 6))}
    refused(kind, begins, mp.simulate_many, **(given | changes))


@pytest.mark.filterwarnings("ignore::multiphi_exudyn.MultiPhiWarning")
@pytest.mark.parametrize("modes", [2, "all"], ids=["truncated", "whole"])
def test_a_further_run_takes_few_calls(modes):
    """Of Python, which one thread at a time does; with and without warnings of its own."""
    own, calls = model(modes, stiffness=50.0), []

    def counted(count):
        calls.clear()
        threading.setprofile(lambda frame, event, _: calls.append(frame.f_code.co_name) if event == "call" else None)
        try:
            mp.simulate_many(own, END, starts(count, most=0.11), points=["m5"], threads=1)
        finally:
            threading.setprofile(None)
        return len(calls)

    first = counted(300)
    assert counted(900) - first < 600 * 40
