"""A modal force that is held constant moves a body as a constant load moves the structure."""

import math

import numpy as np
import pytest
from small_structures import chain

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import coupled as exact_motion
from multiphi_exudyn.exudyn_plugin.attached import AttachedInertia, PointInertia
from multiphi_exudyn.exudyn_plugin.coupled import ExactMotion, LevelForces
from multiphi_exudyn.exudyn_plugin.interface import _direct_reactions
from multiphi_exudyn.time import motion as chatter
from multiphi_exudyn.time.simulate import Run

T_END = 6.0
STRUCTURE = chain(3, damping=mp.ModalDamping([0.02, 0.01, 0.03]), stiffness=10.0)
LOOSE = mp.LinearStructure(
    np.eye(2), np.array([[4.0, -4.0], [-4.0, 4.0]]), damping=mp.ModalDamping([0.0, 0.02]), points={"m1": 0, "m2": 1}
)
CASES = {
    "compliant": (STRUCTURE, [mp.UnilateralContact("stop", "m2", 0.1, 50.0)], -1.0, "m1"),
    "viscous": (STRUCTURE, [mp.UnilateralContact("stop", "m2", 0.1, 50.0, damping=0.5)], -1.0, "m1"),
    "bounded": (STRUCTURE, [mp.UnilateralContact("stop", "m2", 0.1, 50.0, 0.5, damper="bounded")], -1.0, "m1"),
    "rigid": (STRUCTURE, [mp.UnilateralContact("stop", "m2", 0.1)], -1.0, "m1"),
    "rigid, on what it holds": (STRUCTURE, [mp.UnilateralContact("stop", "m2", 0.1)], -1.0, "m2"),
    "two rigid": (
        STRUCTURE,
        [mp.UnilateralContact("below", "m2", 0.1), mp.UnilateralContact("above", {"m0": -1.0}, 0.02)],
        -1.0,
        "m1",
    ),
    "friction": (STRUCTURE, [mp.Friction("ring", "m2", 0.3, stiffness=40.0)], -1.0, "m1"),
    "friction, where it rubs": (STRUCTURE, [mp.Friction("ring", "m2", 0.3, static_limit=0.4)], -1.0, "m2"),
    "without a support": (LOOSE, [mp.UnilateralContact("stop", "m2", 0.1, 50.0)], -0.2, "m1"),
}


def held(model, row, force):
    """What a force on a point is to the levels of a model."""
    in_base = row[None, :] @ model.base.modes.shapes

    def acting(states):
        level = model.level_at(model.active_links(states))
        rows = in_base @ level.vectors
        return LevelForces(force * rows[0], force * _direct_reactions(level, in_base, rows)[:, 0])

    return acting


@pytest.mark.parametrize("case", CASES)
def test_a_force_on_the_modes_of_every_level_is_a_load(case):
    structure, contacts, force, at = CASES[case]
    model = mp.MultiPhiModel(structure, contacts, modes="all")
    velocity = np.linspace(-1.0, -0.5, structure.n)
    native = mp.simulate(model, T_END, velocity=velocity, loads=[mp.ConstantLoad(at, force)])
    motion = Run(model, T_END, None, velocity).begun()
    exact = ExactMotion(motion.levels, "body", 0.0)
    exact.set_forces(held(model, structure.row(at), force), None)
    found = exact.advance(motion.static_state, 0.0, T_END)
    assert len(native.events) >= 3
    assert [(e.contact, e.kind) for e in exact.events] == [(e.contact, e.kind) for e in native.events]
    assert [e.time for e in exact.events] == pytest.approx([e.time for e in native.events], rel=1e-10)
    assert [e.impulse for e in exact.events] == pytest.approx([e.impulse for e in native.events], rel=1e-9, abs=1e-12)
    ours = model.base.modes.shapes @ found.state.level.configuration(found.state.displacement)
    theirs = native.displacement(T_END)
    assert np.max(np.abs(ours - theirs)) < 1e-10 * np.max(np.abs(theirs))


@pytest.mark.parametrize("case", ["compliant", "two rigid"])
def test_forces_may_change_on_the_way_and_a_trial_leaves_no_trace(case):
    structure, contacts, force, at = CASES[case]
    model = mp.MultiPhiModel(structure, contacts, modes="all")
    velocity = np.linspace(-1.0, -0.5, structure.n)
    loads = [mp.SampledLoad(at, [0.0, 3.0, np.nextafter(3.0, 4.0), T_END], [force, force, -force / 2, -force / 2])]
    native = mp.simulate(model, T_END, velocity=velocity, loads=loads)
    motion = Run(model, T_END, None, velocity).begun()
    exact, row = ExactMotion(motion.levels, "body", 0.0), structure.row(at)
    exact.set_forces(held(model, row, force), None)
    exact.advance(motion.static_state, 0.0, 3.0, stop=True, trial=True)
    first = exact.advance(motion.static_state, 0.0, 3.0)
    exact.set_forces(held(model, row, -force / 2), None)
    then = exact.advance(first.state, 3.0, T_END)
    times = [event.time for event in exact.events]
    assert times == pytest.approx([event.time for event in native.events], rel=1e-8)
    ours = model.base.modes.shapes @ then.state.level.configuration(then.state.displacement)
    assert np.max(np.abs(ours - native.displacement(T_END))) < 1e-7 * np.max(np.abs(ours))


def test_a_motion_stops_at_its_first_event_and_says_what_was_right_before():
    structure, contacts, force, at = CASES["rigid"]
    model = mp.MultiPhiModel(structure, contacts, modes="all")
    motion = Run(model, T_END, None, np.full(structure.n, -1.0)).begun()
    exact = ExactMotion(motion.levels, "body", 0.0)
    exact.set_forces(held(model, structure.row(at), force), None)
    reached = exact.advance(motion.static_state, 0.0, T_END, stop=True)
    assert reached.changed
    assert {event.time for event in exact.events} == {reached.time}
    level = model.level_at(())
    assert level.gap_rows[0] @ reached.state_before.velocity < 0
    assert 0.1 + level.gap_rows[0] @ reached.state_before.displacement == pytest.approx(0.0, abs=1e-12)
    assert not math.isclose(reached.state.kinetic, reached.state_before.kinetic)


def test_levels_that_have_become_too_large_are_made_anew(monkeypatch):
    structure, contacts, force, at = CASES["two rigid"]
    model = mp.MultiPhiModel(structure, contacts, modes="all")
    found = []
    for limit in (exact_motion.LEVEL_BYTES, 0):
        monkeypatch.setattr(exact_motion, "LEVEL_BYTES", limit)
        motion = Run(model, T_END, None, np.full(structure.n, -1.0)).begun()
        exact, state = ExactMotion(motion.levels, "body", 0.0), motion.static_state
        for k in range(6):
            exact.set_forces(held(model, structure.row(at), force), None)
            state = exact.advance(state, float(k), float(k + 1)).state
        found.append((state, exact.events))
    (one, before), (other, after) = found
    assert [event.time for event in before] == [event.time for event in after]
    np.testing.assert_array_equal(one.displacement, other.displacement)


@pytest.mark.parametrize("case", CASES)
def test_bodies_that_take_turns_move_as_each_one_alone(case):
    """They share levels, with a third one that fails on the way; some have forces, some masses on their points."""
    structure, contacts, force, at = CASES[case]
    row = structure.row(at)

    def body(model, size):
        velocity = np.linspace(-1.0, -0.5, structure.n)
        motion = Run(model, T_END, None, velocity).begun()
        in_base = row[None, :] @ model.base.modes.shapes
        attached = AttachedInertia(np.array([[0.7]]), np.eye(1))
        rows_in = lambda states: in_base @ model.level_at(model.active_links(states)).vectors  # noqa: E731
        inertia = PointInertia(attached, model.base, in_base, rows_in)
        exact, state = ExactMotion(motion.levels, "body", 0.0), motion.static_state
        for k in range(30):
            t = 0.2 * k
            exact.set_forces(held(model, row, size * force * (1 - t / T_END)), inertia if size > 1 else None)
            exact.advance(state, t, t + 0.2, trial=True)
            state = exact.advance(state, t, t + 0.2).state
            yield state.displacement, state.velocity, [event.time for event in exact.events]

    def model():
        return mp.MultiPhiModel(structure, contacts, modes="all")

    shared, sizes = model(), (0.5, 1.0, 1.5)
    together = zip(*(body(shared, size) for size in sizes), strict=True)
    apart = zip(*(body(model(), size) for size in sizes), strict=True)
    broken = body(shared, math.nan)
    for k, (found, expected) in enumerate(zip(together, apart, strict=True)):
        for ours, theirs in zip(found, expected, strict=True):
            assert all(np.array_equal(a, b) for a, b in zip(ours, theirs, strict=True))
        if k == 3:
            with pytest.raises(mp.MultiPhiError, match="not finite"):
                next(broken)
    assert all(len(events) >= 3 for *_, events in found)


def test_chatter_is_that_of_one_body_alone(monkeypatch):
    """The ring of the chatter check goes with the body."""
    structure, contacts, force, at = CASES["rigid"]
    model = mp.MultiPhiModel(structure, contacts, modes="all")
    monkeypatch.setattr(chatter, "CHATTER_WINDOW", 4)
    monkeypatch.setattr(chatter, "EVENTS_PER_PERIOD", 2)
    bodies = []
    for _ in range(3):
        motion = Run(model, T_END, None, np.full(structure.n, -1.0)).begun()
        bodies.append((ExactMotion(motion.levels, "body", 0.0), motion.static_state))
    for exact, state in bodies:
        exact.set_forces(held(model, structure.row(at), force), None)
        exact.advance(state, 0.0, 2.0)
        assert len(exact.events) == 2


def test_a_failure_says_whose_it_is_and_when():
    structure, contacts, _, at = CASES["rigid"]
    model = mp.MultiPhiModel(structure, contacts, modes="all")
    motion = Run(model, T_END, None, np.full(structure.n, -1.0)).begun()
    exact = ExactMotion(motion.levels, "body 'beam'", 0.0)
    exact.set_forces(held(model, structure.row(at), math.nan), None)
    with pytest.raises(mp.MultiPhiError, match=r"body 'beam': at t = 0\.5 s: the motion is not finite"):
        exact.advance(motion.static_state, 0.5, T_END)


def test_a_level_that_cannot_be_made_ends_a_step_at_its_start():
    structure, contacts, force, at = CASES["rigid"]
    model = mp.MultiPhiModel(structure, contacts, modes="all")
    motion = Run(model, T_END, None, np.full(structure.n, -1.0)).begun()
    exact = ExactMotion(motion.levels, "body 'beam'", 0.0)
    exact.set_forces(held(model, structure.row(at), force), None)
    end = exact.advance(motion.static_state, 0.0, 2.0)
    times = [event.time for event in exact.events]

    def fails(states):
        raise mp.MultiPhiError("no such level")

    exact.set_forces(fails, None)
    with pytest.raises(mp.MultiPhiError, match=r"body 'beam': at t = 2 s: no such level"):
        exact.advance(end.state, 2.0, 3.0)
    assert [event.time for event in exact.events] == times
    exact.set_forces(held(model, structure.row(at), force), None)
    exact.advance(end.state, 2.0, T_END)
    assert len(exact.events) > len(times) > 0
