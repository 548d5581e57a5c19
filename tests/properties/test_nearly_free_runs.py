"""Runs of structures that a far softer spring holds than bend them."""

import math
import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose

import multiphi_exudyn as mp


def chain(ground):
    """Three masses in a row, and a spring to the ground."""
    stiffness = np.array([[5.5, -5.5, 0.0], [-5.5, 23.5, -18.0], [0.0, -18.0, 18.0]])
    stiffness[0, 0] += ground
    return mp.LinearStructure(np.diag([0.7, 0.9, 2.0]), stiffness, points={"left": 0, "middle": 1, "right": 2})


@pytest.mark.parametrize("ground", [1e-10, 1e-9, 1e-8])
def test_friction_beside_rigid_stops_sticks_as_on_a_free_structure(ground):
    """The force of its spring is at the limit as it sticks: a rest of it would make it slip on, against its slip."""
    contacts = [
        mp.UnilateralContact("below", {"right": -1.0}, 0.0),
        mp.UnilateralContact("across", {"left": 0.9, "middle": 1.0, "right": 0.2}, 0.0),
        mp.Friction("rubs", {"left": 1.0, "right": -1.0}, 1.3, stiffness=11.0),
    ]

    def run(ground):
        model = mp.MultiPhiModel(chain(ground), contacts, modes="all")
        return mp.simulate(model, 1.0, displacement=np.zeros(3), velocity=[-1.6, 0.1, 0.7])

    held, free = run(ground), run(0.0)
    assert [event.kind for event in held.events][:4] == ["close", "close", "slip", "stick"]
    assert [(event.kind, event.contact) for event in held.events] == [(e.kind, e.contact) for e in free.events]
    times = np.linspace(0.0, 1.0, 50)
    assert_allclose(held.displacement(times), free.displacement(times), rtol=0, atol=1e-7)


@pytest.mark.parametrize("ground", [1e-10, 3e-10, 1e-9, 1e-8])
@pytest.mark.parametrize("speed", [-1.6, -1.1])
@pytest.mark.filterwarnings("ignore:slow mode:multiphi_exudyn.MultiPhiWarning")
def test_events_far_from_an_equilibrium_are_those_of_the_free_structure(ground, speed):
    """It rests 0.1 N / 1e-10 N/m away: the slow mode carries the friction, and round-off of it closes no contact."""
    stiffness = np.array([[4.7, -4.7, 0, 0], [-4.7, 10.1, -5.4, 0], [0, -5.4, 38.4, -33.0], [0, 0, -33.0, 33.0]])
    contacts = [
        mp.UnilateralContact("between", {"b": 1.0, "a": -1.0}, 0.25),
        mp.Friction("rubs", {"b": 1.0, "d": -1.0}, 0.9, stiffness=1000.0),
    ]

    def run(ground):
        held = stiffness + np.diag([ground, 0.0, 0.0, 0.0])
        structure = mp.LinearStructure(
            np.diag([1.1, 0.8, 1.75, 1.95]), held, points=dict(zip("abcd", range(4), strict=True))
        )
        loads = [mp.Gravity([1.0, -1.0, 1.0, -1.0], 1.0)]
        return mp.simulate(
            mp.MultiPhiModel(structure, contacts, modes="all"), 9.0, velocity=[-0.1, speed, -0.4, 0.0], loads=loads
        )

    slow, free = run(ground), run(0.0)
    assert (slow.status, len(slow.events)) == ("ok", len(free.events))
    assert len(free.events) > 50
    times = np.linspace(0.0, 9.0, 50)
    assert_allclose(slow.displacement(times), free.displacement(times), rtol=0, atol=1e-5)


def slow_modes(run):
    return [text for text in run.warnings if text.startswith("slow mode: ")]


def pressed(ground):
    """The chain that a constant force presses on a stop, on which it bounces."""
    stop = mp.UnilateralContact("stop", {"left": 1.0}, 0.1, 400.0)
    model = mp.MultiPhiModel(chain(ground), [stop], modes="all")
    loads = [mp.ConstantLoad({"left": 1.0, "middle": 1.0, "right": 1.0}, -3.0)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mp.MultiPhiWarning)
        return mp.simulate(model, 8.0, displacement=[0.02, 0.0, -0.01], velocity=[0.3, -0.2, 0.1], loads=loads)


@pytest.mark.parametrize(("ground", "told"), [(1e-11, True), (1e-9, True), (1e-6, False), (1e-4, False), (0.0, False)])
def test_digits_that_a_far_rest_takes_are_told_before_they_spoil_the_motion(ground, told):
    """It rests 9 N / 1e-11 N/m away from the stop, and moves by a metre."""
    run, free = pressed(ground), pressed(0.0)
    assert len(run.events) > 6
    sentences = slow_modes(run)
    assert len(sentences) == told
    early = np.linspace(0.0, 2.0, 50)
    off = np.max(np.abs(run.displacement(early) - free.displacement(early)))
    assert off < 1e-6 + ground or told
    if told:
        assert f"{len(run.events)} events" in sentences[0]
        assert sentences[0].endswith("; hold it, or make its stiffness exactly zero")


@pytest.mark.parametrize("frequency", [0.01, 0.1, 0.5])
@pytest.mark.parametrize("end", [1e-3, 0.1, 1.0])
@pytest.mark.filterwarnings("ignore:slow model:multiphi_exudyn.MultiPhiWarning")
def test_suspensions_are_not_told(frequency, end):
    """A body on its suspension, struck: it rests 2.5 km away for 0.01 Hz, and its motion is right."""
    body = mp.LinearStructure(np.eye(1), [[(2 * math.pi * frequency) ** 2]], points={"m": 0})
    stop = mp.UnilateralContact("stop", {"m": 1.0}, 1e-5, 1e8)
    model = mp.MultiPhiModel(body, [stop], modes="all")
    run = mp.simulate(model, end, velocity=[-0.1], loads=[mp.ConstantLoad("m", -9.81)])
    assert slow_modes(run) == []
