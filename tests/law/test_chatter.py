"""Chatter is too many events in too short a time; what a load is made of does not count."""

import numpy as np
import pytest
from campaign_scenes import scene_of
from small_structures import chain, stop

from multiphi_exudyn import (
    ForceLaw,
    Friction,
    HarmonicLoad,
    LinearStructure,
    MultiPhiModel,
    SampledLoad,
    UnilateralContact,
    simulate,
)
from multiphi_exudyn.study.law_check import broken_laws


def test_samples_of_a_load_are_no_events():
    """A slow force presses two masses on a stop again and again; every sample begins a piece of its own."""
    t = np.linspace(0.0, 4.0, 260)
    load = SampledLoad("m1", t, 5 * np.sin(2 * np.pi * t))
    model = MultiPhiModel(chain(2, damping=0.5 * np.eye(2), stiffness=30.0), [stop("m1", 0.05, 1e3)], modes="all")
    run = simulate(model, 4.0, loads=[load])
    assert run.status == "ok", run.message
    assert len(run.segments) > 260
    assert 5 < len(run.events) < 50


SWINGS = 100  # of a load of 1 N and 5 Hz


def saw():
    """The same as samples."""
    times = np.arange(2 * SWINGS + 1) / 10
    return SampledLoad("m", times, np.where(np.arange(len(times)) % 2, -1.0, 1.0))


@pytest.mark.parametrize("load", [HarmonicLoad("m", 1.0, 5.0), saw()], ids=["harmonic", "sampled"])
def test_friction_may_follow_a_load_that_is_faster_than_every_mode(load):
    """A block of 1 kg on a spring of 0.1 N/m slips and sticks twice in every swing of the load."""
    block = LinearStructure([[1.0]], [[0.1]], points={"m": 0})
    model = MultiPhiModel(block, [Friction("pad", "m", 0.5)])
    run = simulate(model, SWINGS / 5, loads=[load])
    assert run.status == "ok", run.message
    assert len(run.events) >= 3.9 * SWINGS


def run_of(kind, number):
    """The run of a scene of the campaign, and the laws that it breaks."""
    scene = scene_of(kind, number)
    run = simulate(scene.model, scene.t_end, scene.displacement, scene.velocity, scene.loads)
    return run, broken_laws(run, scene.loads, (scene.displacement, scene.velocity))


@pytest.mark.parametrize(
    "number",
    [
        *(3, 25, 37),  # contacts that truncation has left inside their stops are missing where all could carry
        *(46, 112, 140),  # one of them is struck by what truncation makes of a velocity that is zero, and opens again
    ],
)
def test_a_truncated_pipe_comes_to_rest_on_its_racks(number):
    run, broken = run_of("racks", number)
    assert run.status == "ok", run.message
    assert not broken
    assert len(run.events) < 5000


@pytest.mark.parametrize("number", [1, 2])
def test_a_bar_falls_flat_on_a_bed_of_stops(number):
    """Contacts that exchange their states faster than the modes can follow are held open for a period."""
    run, broken = run_of("landings", number)
    assert run.status == "ok", run.message
    assert not broken


def closings_in_a_period(run):
    """The largest number of closings of one contact within a period of the fastest mode."""
    period, most = 1 / run.model.highest_frequency, 0
    for name in run.contacts:
        times = np.unique([event.time for event in run.events if event.contact == name and event.kind == "close"])
        counts = np.searchsorted(times, times + period) - np.arange(len(times))
        most = max(most, int(np.max(counts, initial=0)))
    return most


def test_no_contact_closes_more_often_than_the_modes_can_follow():
    run, _ = run_of("landings", 2)
    assert 1 < closings_in_a_period(run) <= 8


@pytest.mark.parametrize(("kind", "number"), [("racks", 3), ("racks", 46), ("landings", 2)])
def test_the_remedy_that_chatter_names_works(kind, number):
    """On a residual boundary rigid contacts have no impacts."""
    scene = scene_of(kind, number)
    given = scene.model
    model = MultiPhiModel(given.structure, given.contacts, modes=given.modes, boundary="residual")
    run = simulate(model, scene.t_end, scene.displacement, scene.velocity, scene.loads)
    assert run.status == "ok", run.message


@pytest.mark.parametrize(("count", "gap"), [(12, 0.1), (16, 0.1), (17, 0.55), (20, 0.1), (24, 0.25), (32, 0.1)])
def test_contacts_that_open_together_by_symmetry(count, gap):
    """A string of all its modes, plucked in the middle above stops that it touches in pairs."""
    k = np.arange(1, count)
    plucked = 8 / np.pi**2 / k**2 * np.sin(k * np.pi / 2) / np.sqrt(2)
    points = {f"p{j}": np.sqrt(2) * np.sin(k * np.pi * j / count) for j in range(1, count)}
    string = LinearStructure(np.eye(count - 1), np.diag((np.pi * k) ** 2), points=points)
    stops = [UnilateralContact(f"c{j}", f"p{j}", gap) for j in range(1, count)]
    run = simulate(MultiPhiModel(string, stops, modes="all"), 4.0, displacement=plucked)
    assert run.status == "ok", run.message


def test_a_law_of_many_knots_is_passed_in_a_moment():
    """300 knots in a band that the mass crosses in a thousandth of a period, to and fro."""
    inner = 1e-3 * np.linspace(-1, 1, 300)
    knots = np.r_[-1.0, inner, 1.0]
    law = ForceLaw("m", (knots, np.interp(knots, inner, np.tanh(3e3 * inner)) + knots), name="law")
    mass = LinearStructure([[1.0]], [[1.0]], points={"m": 0})
    run = simulate(MultiPhiModel(mass, [law], modes="all"), 20.0, velocity=[0.5])
    assert run.status == "ok", run.message
    assert len(run.events) > 1800
    assert abs(run.ledger.residual) < 1e-9 * run.ledger.initial
