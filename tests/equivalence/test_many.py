"""Many runs at once are each what they are alone, to the bit, however many threads there are."""

import math

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from small_structures import chain, stop

import multiphi_exudyn as mp
import multiphi_exudyn._core as core
from multiphi_exudyn.time.model_warnings import kept_back

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
def test_a_tolerance_is_decided_by_the_first_run():
    first, second = model(mp.Tolerance(0.02)), model(mp.Tolerance(0.02))
    runs = alone(first, starts(4))
    check(mp.simulate_many(second, END, starts(4), points=["m5"], times=TIMES, threads=3), runs, ["m5"])
    assert second.decided.modes == first.decided.modes


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
