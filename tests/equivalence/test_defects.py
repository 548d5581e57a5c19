"""Defects: what the loop adds up is their definition, and between two levels the state before is enough for it."""

import math
import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_structures import chain

import multiphi_exudyn as mp
from multiphi_exudyn.time.simulate import Run
from multiphi_exudyn.time.truncation import defects, total_defect


def simulated(model, t_end, **given):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mp.MultiPhiWarning)
        return mp.simulate(model, t_end, **given)


def rest(directions, motion):
    """What is left of a motion across directions."""
    return motion - directions @ np.linalg.lstsq(directions, motion, rcond=None)[0] if directions.size else motion


def of_instants(run):
    """|d|^2 + |w / Omega|^2 of all instants at which another level is entered, by their times, of y and v in all modes.

    Of those with one decision; who is struck stays closed.
    """
    segments, base, found = run.segments, run.model.base, {}
    for k in range(1, len(segments.starts)):
        before, after = (segments.levels[segments.numbers[i]] for i in (k - 1, k))
        if before.states == after.states or np.count_nonzero(segments.starts == segments.starts[k]) > 1:
            continue
        passed = segments.ends[k - 1] - segments.starts[k - 1]
        states = segments.states(np.array([k - 1, k]), np.array([passed, 0.0]))
        (x, v), (x_after, v_after) = states[:, 0, : before.width], states[:, 1, : after.width]
        held = base.directions[:, [i for i in after.level.indices if base.links[i].rigid]]
        d = rest(held, before.configuration(x) - after.configuration(x_after))
        w = rest(held, before.level.vectors @ v - after.level.vectors @ v_after) * base.periods
        found[segments.starts[k]] = d @ d + w @ w
    return found


def rough_chain(modes):
    """Two rough rigid stops and a spring that slips, under a load that varies."""
    contacts = [
        mp.UnilateralContact("floor", "m2", 0.02, friction=0.4, tangential="m1"),
        mp.UnilateralContact("wall", "m5", 0.05, friction=0.2, tangential="m4"),
        mp.Friction("pad", "m3", 0.05, stiffness=40.0),
    ]
    return mp.MultiPhiModel(chain(7), contacts, modes=modes)


def beside_each_other(stiffness, modes, **given):
    """Four stops on a chain, two of them at one height: levels are passed through at one instant."""
    contacts = [
        mp.UnilateralContact(f"c{i}", f"m{i + 2}", gap, stiffness, **given)
        for i, gap in enumerate((0.05, 0.05, 0.1, 0.02))
    ]
    return mp.MultiPhiModel(chain(7), contacts, modes=modes)


def padded(stops, pads, modes, limit):
    """Rigid friction on a chain, beside rigid stops: some slip on beside an impact, several begin to at one instant."""
    contacts = [mp.UnilateralContact(f"c{i}", f"m{point}", 0.05) for i, point in enumerate(stops)]
    contacts += [mp.Friction(f"pad{i}", at, limit, static_limit=1.5 * limit) for i, at in enumerate(pads)]
    return mp.MultiPhiModel(chain(7), contacts, modes=modes)


WEIGHT = tuple(mp.ConstantLoad(f"m{i}", -0.03) for i in range(7))
PULL = (mp.HarmonicLoad("m6", -0.4, 0.11), mp.HarmonicLoad("m2", 0.3, 0.37))
END = 40.0
JUMPS = (mp.SampledLoad("m6", [0.0, 5.0, 5.01, 9.0, 9.01, 60.0], [0.0, 0.2, -0.5, -0.4, 0.3, -0.4]),)
CASES = {
    "compliant": (beside_each_other(20.0, 3), ()),
    "viscous": (beside_each_other(20.0, 3, damping=2.0), PULL),
    "rigid, jumps": (beside_each_other(math.inf, 3), WEIGHT + JUMPS),
    "rigid, loads": (beside_each_other(math.inf, 3), WEIGHT + PULL),
    "jumps": (beside_each_other(5.0, 2), JUMPS),
    "rough": (rough_chain(3), WEIGHT),
    "stops and pads": (padded([3, 6], ["m1", "m5"], 2, 0.05), WEIGHT + PULL),
    "pads": (padded([], ["m1", "m4", {"m1": 1.0, "m4": -1.0}], 2, 0.1), PULL),
    "rough, loads": (rough_chain(3), WEIGHT + PULL),
    "most modes": (beside_each_other(20.0, 5), ()),  # two levels have more coordinates together than there are modes
    "most modes, rigid": (beside_each_other(math.inf, 5), WEIGHT + PULL),
}


@pytest.mark.parametrize("kind", CASES)
def test_what_the_loop_adds_up_is_the_definition(kind):
    """Where it knows it; also where a contact is struck and stays closed, and where levels are passed through."""
    model, loads = CASES[kind]
    start = {"velocity": -np.linspace(0.1, 0.4, 7), "loads": loads}
    whole = simulated(model, END, **start)
    exact, impacts = of_instants(whole), {event.time for event in whole.events if event.impulse > 0}
    run, known, struck = Run(model, END, **start).begun(), 0, 0
    for instant, expected in exact.items():
        run.advance(float(instant) * (1 - 1e-9))
        run._run.defects = 0.0
        run.advance(float(instant) * (1 + 1e-9))
        added = run._run.defects
        if not math.isnan(added):
            assert_allclose(added, expected, rtol=1e-9, atol=1e-12 * max(exact.values()))
            known, struck = known + 1, struck + (instant in impacts)
    assert known > 5
    assert struck > 0 or not impacts


@pytest.mark.parametrize("seed", [3, 13, 15])
def test_a_start_that_sticks_is_left_to_those_who_look_at_all_modes(seed):
    """Rigid friction that sticks holds its link: the speed along it, which the kept modes lack, is prevented."""
    model = mp.MultiPhiModel(chain(7), [mp.Friction("pad", "m2", 0.3)], modes=2)
    run = simulated(model, 1.0, velocity=np.random.default_rng(seed).normal(size=7))
    assert (run.events[0].kind, run.events[0].time) == ("stick", 0.0)
    exact = sum(defect.size**2 for defect in defects(run))
    assert_allclose(total_defect(run), exact, rtol=1e-12)
