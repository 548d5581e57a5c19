"""Many runs at once are each what they are alone, to the bit, however many threads there are."""

import dataclasses
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


class TestVariedNumbers:
    """Each run is that of its own model under its own loads, to the bit."""

    LOADS = (mp.HarmonicLoad("m1", 0.3, 0.2),)

    def own(self, given, gap, stiffness, amplitude):
        first, other = given.contacts
        changed = [dataclasses.replace(first, gap=gap, stiffness=stiffness), other]
        x = np.full(6, 0.2)
        loads = [dataclasses.replace(self.LOADS[0], amplitude=amplitude)]
        with kept_back():
            return mp.simulate(mp.MultiPhiModel(given.structure, changed, modes=4), END, displacement=x, loads=loads)

    @pytest.mark.filterwarnings("ignore::multiphi_exudyn.MultiPhiWarning")
    @pytest.mark.parametrize("stiffnesses", [np.full(5, 50.0), np.linspace(20.0, 90.0, 5)], ids=["gaps", "stiffness"])
    def test_of_contacts_and_loads(self, stiffnesses):
        given, gaps, amplitudes = model(stiffness=50.0), np.linspace(0.05, 0.15, 5), np.linspace(0.1, 0.5, 5)
        vary = {"stop.gap": gaps, "stop.stiffness": stiffnesses, "loads.0.amplitude": amplitudes}
        found = mp.simulate_many(
            given,
            END,
            displacements=np.full(6, 0.2),
            loads=self.LOADS,
            points=["m5"],
            times=TIMES,
            vary=vary,
            contacts=["stop"],
            threads=2,
        )
        table = found.to_dataframe()
        for k, numbers in enumerate(zip(gaps, stiffnesses, amplitudes, strict=True)):
            run = self.own(given, *numbers)
            assert_array_equal(found.samples[k, 0], run.at("m5", TIMES))
            assert_array_equal(found.forces[k, 0], run.contact_force("stop", TIMES))
            assert found.impulses[k, 0] == run.contact_impulse("stop", 0.0, END)
            assert found.contact_times[k, 0] == sum(b - a for a, b in run.contact_intervals("stop"))
            assert table["events"][k] == len(run.events)
            assert table["stop.gap"][k] == gaps[k]
        assert set(found.status) == {"ok"}

    def test_other_gaps_take_the_levels_that_there_are(self):
        given = model(stiffness=50.0)
        mp.simulate(given, END, displacement=np.full(6, 0.2))
        first, other = given.contacts
        changed = dataclasses.replace(given, contacts=[dataclasses.replace(first, gap=0.11), other])
        built = changed.levels_built
        run = mp.simulate(changed, END, displacement=np.full(6, 0.2))
        own = mp.simulate(
            mp.MultiPhiModel(given.structure, changed.contacts, modes=4), END, displacement=np.full(6, 0.2)
        )
        assert [event.time for event in run.events] == [event.time for event in own.events]
        assert_array_equal(run.at("m5", TIMES), own.at("m5", TIMES))
        assert changed.modal_levels is given.modal_levels
        assert changed.levels_built == given.levels_built >= built

    @pytest.mark.parametrize(
        ("vary", "told"),
        [
            ({"stop.gap": np.ones((2, 2))}, "need arrays"),
            ({"stop.gap": np.ones(2), "above.gap": np.ones(3)}, "k the same for all"),
            ({"stop.name": np.ones(2)}, "need a number of it: gap"),
            ({"tap.gap": np.ones(2)}, "'tap'"),
            ({"loads.1.amplitude": np.ones(2)}, "need the number of a load, 0 to 0"),
            (["stop.gap"], "need a mapping"),
        ],
    )
    def test_refusals_name_what_was_given(self, vary, told):
        with pytest.raises(mp.MultiPhiError, match=told):
            mp.simulate_many(model(), END, loads=self.LOADS, vary=vary)

    def test_a_contact_that_never_closes_is_closed_for_no_time(self):
        found = mp.simulate_many(
            model(stiffness=50.0), END, displacements=np.zeros(6), vary={"stop.gap": [0.1, 0.2]}, contacts=["stop"]
        )
        assert_array_equal(found.contact_times, np.zeros((2, 1)))
        assert_array_equal(found.impulses, np.zeros((2, 1)))
