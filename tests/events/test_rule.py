"""The event rule on scenes that break weaker rules: refusals, contacts that touch together, degenerate starts.

The scenes of ``TestSmallestScenes`` are the smallest in which one sentence of the rule decides.
"""

import dataclasses
import math

import numpy as np
import pytest
from campaign_scenes.plain import built, recipe_of
from hypothesis import given, settings
from hypothesis import strategies as st
from lawful import complaints
from numpy.testing import assert_allclose
from small_structures import chain, oscillator, random_model, stop

from multiphi_exudyn import (
    ConstantLoad,
    LevelOverride,
    LinearStructure,
    MultiPhiModel,
    UnilateralContact,
    planar_beam,
    simulate,
)
from multiphi_exudyn.time import motion as chatter
from reference_models.rig import rig_beam, rig_contact

DAMPINGS = ("none", "modal", "rayleigh", "given")


def random_run(seed, *, t_end=4.0, loaded=False, **kinds):
    m, random = random_model(seed, **kinds)
    velocity = 2 * random.normal(size=m.structure.n)
    loads = [ConstantLoad(f"m{random.integers(m.structure.n)}", float(3 * random.normal()))] if loaded else ()
    return m, simulate(m, t_end, velocity=velocity, loads=loads)


def scale_of(run):
    """Energy [J] that the ledger's round-off is measured against."""
    return max(run.ledger.initial, abs(run.ledger.work_of_loads))


class TestWhateverTheScene:
    @settings(max_examples=30)
    @given(st.integers(0, 2**31), st.sampled_from(DAMPINGS), st.booleans(), st.booleans(), st.booleans())
    def test_the_ledger_closes_and_a_failure_names_its_cause(self, seed, damping, rigid_body, truncated, loaded):
        _, run = random_run(seed, damping=damping, rigid_body=rigid_body, truncated=truncated, loaded=loaded)
        assert abs(run.ledger.residual) <= 1e-10 * scale_of(run)
        assert run.ledger.impact >= -1e-10 * scale_of(run)
        assert run.ledger.truncation_kinetic >= -1e-10 * scale_of(run)
        assert run.ledger.damping >= -1e-10 * scale_of(run)
        assert run.status == "ok" or run.message.startswith("at t = ")

    @settings(max_examples=25)
    @given(st.integers(0, 2**31), st.sampled_from(DAMPINGS), st.booleans(), st.booleans())
    def test_with_all_modes_the_laws_of_contact_hold(self, seed, damping, rigid_body, loaded):
        m, run = random_run(seed, damping=damping, rigid_body=rigid_body, truncated=False, loaded=loaded)
        if run.status != "ok":
            assert "chatter" in run.message
            return
        assert abs(run.ledger.truncation_kinetic) + abs(run.ledger.truncation_strain) <= 1e-9 * scale_of(run)
        t = np.linspace(0, run.t_end, 2001)
        for contact in m.contacts:
            gap, force = run.gap(contact.name, t), run.contact_force(contact.name, t)
            size = max(1.0, np.max(np.abs(gap)))
            if contact.rigid:
                assert np.min(gap) >= -1e-9 * size
                assert np.min(force) >= -1e-8 * max(1.0, np.max(np.abs(force)))
                assert np.max(np.abs(gap * force)) <= 1e-8 * size * max(1.0, np.max(np.abs(force)))
            else:
                law = contact.stiffness * np.maximum(0.0, -gap)
                assert_allclose(force, law, atol=1e-9 * contact.stiffness * size)

    @settings(max_examples=20)
    @given(st.integers(0, 2**31), st.booleans())
    def test_with_all_modes_energy_never_rises(self, seed, rigid_body):
        _, run = random_run(seed, rigid_body=rigid_body, truncated=False)
        energies = run.energy(np.linspace(0, run.t_end, 2001))
        assert np.max(np.diff(energies)) <= 1e-9 * run.ledger.initial
        assert energies[0] <= run.ledger.initial * (1 + 1e-12)

    @settings(max_examples=20)
    @given(st.integers(0, 2**31), st.sampled_from(DAMPINGS), st.booleans())
    def test_a_truncated_rigid_contact_never_pulls(self, seed, damping, rigid_body):
        m, run = random_run(seed, damping=damping, rigid_body=rigid_body, kind="rigid")
        t = np.linspace(0, run.t_end, 2001)
        for contact in m.contacts:
            force = run.contact_force(contact.name, t)
            assert np.min(force) >= -1e-8 * max(1.0, np.max(np.abs(force)))


@pytest.mark.parametrize(("seed", "damping"), [(199, "given"), (1047, "given"), (1429, "modal"), (2747, "given")])
def test_a_rigid_contact_does_not_wait_for_its_reaction_to_rise_to_zero(seed, damping):
    """Closed at the start, with a reaction that truncation has put below zero and that rises: it opens at once."""
    m, run = random_run(seed, t_end=3.0, damping=damping, kind="rigid")
    assert [event.kind for event in run.events if event.time == 0][:2] == ["close", "open"]
    t = np.linspace(0, 3, 3001)
    assert min(np.min(run.contact_force(contact.name, t)) for contact in m.contacts) >= -1e-9


def test_a_refused_contact_requests_a_change_only_where_it_may_close():
    """80 of 122 modes: the reaction of the level to enter is round-off of terms 1e9 times as large."""
    m = MultiPhiModel(planar_beam(rig_beam(), elements=57), [rig_contact()], modes=80)
    x = m.static_equilibrium({"node3": 1.0})
    run = simulate(m, 0.09, displacement=0.02 * x / (m.structure.row("node3") @ x))
    assert run.status == "ok"
    assert all(segment.end > segment.start for segment in run.segments)


class TestSmallestScenes:
    def test_an_impact_that_stops_the_only_mode_holds_it(self):
        """One mode: after the impact its velocity is round-off of the one before, not of itself."""
        m = oscillator(gap=-1.0, contact=math.inf)
        run = simulate(m, 5.0, displacement=[3.0])
        assert [event.kind for event in run.events] == ["close"]
        assert_allclose(run.gap("stop", 5.0), 0, atol=1e-15)
        assert_allclose(run.contact_force("stop", 5.0), 8.0, rtol=1e-12)

    def test_a_stop_struck_before_anything_is_strained_stays_closed(self):
        """Zero acceleration after the impact, and a reaction that grows with time: the next derivative decides."""
        m = MultiPhiModel(chain(2), [stop("m0", 0.0)], modes="all")
        run = simulate(m, 1.0, velocity=[-1.0, -1.0])
        assert [event.kind for event in run.events] == ["close"]
        assert_allclose(run.at("m1", 0.5), -math.sin(0.5), rtol=1e-12)  # m1 alone, m0 held
        assert_allclose(run.contact_force("stop", 0.5), math.sin(0.5), rtol=1e-12)

    def test_contacts_that_touch_at_one_instant_share_every_impact_of_it(self):
        """A row of three balls against a wall at zero distances: all stop, none passes the other."""
        structure = LinearStructure(np.eye(3), np.zeros((3, 3)), points={"a": 0, "b": 1, "c": 2})
        wall = [stop("a", 0.0, name="wall")]
        pairs = [UnilateralContact(f"{p}{q}", {q: 1.0, p: -1.0}, 0.0) for p, q in ("ab", "bc")]
        run = simulate(MultiPhiModel(structure, wall + pairs, modes="all"), 2.0, velocity=[0.0, 0.0, -3.0])
        assert_allclose(run.displacement(2.0), 0, atol=1e-12)
        assert_allclose(run.contact_impulse("wall", 0.0, 2.0), 3.0, rtol=1e-12)
        assert_allclose(run.ledger.impact, 4.5, rtol=1e-12)

    @pytest.mark.parametrize("rigid_body", [False, True])
    def test_contacts_heard_one_after_the_other_at_one_instant_are_decided_together(self, rigid_body):
        """Three stops at zero distance of a damped chain, touched within a microsecond of each other."""
        m, run = random_run(1003, t_end=5.0, damping="given", rigid_body=rigid_body, truncated=False)
        assert run.status == "ok"
        for contact in m.contacts:
            assert np.min(run.gap(contact.name, np.linspace(0, 5, 4001))) >= -1e-12

    def test_a_point_mass_falls_on_a_stop_and_stays(self):
        """No stiffness at all: rigid-body mode, constant load, the stop carries the weight."""
        structure = LinearStructure([[2.0]], [[0.0]], points={"m0": 0})
        for damping in (None, [[0.0]]):
            body = dataclasses.replace(structure, damping=damping)
            run = simulate(MultiPhiModel(body, [stop(gap=5.0)], modes="all"), 3.0, loads=[ConstantLoad("m0", -20.0)])
            assert [event.kind for event in run.events] == ["close"]
            assert_allclose(run.events[0].time, 1.0, rtol=1e-14)
            assert_allclose(run.events[0].energy_loss, 100.0, rtol=1e-12)
            assert_allclose(run.contact_force("stop", 2.0), 20.0, rtol=1e-12)

    def test_bodies_that_meet_in_flight_keep_their_common_motion(self):
        """Two free masses: plastic, m v each; and against a spring between them, which gives everything back."""
        structure = LinearStructure(np.diag([1.0, 3.0]), np.zeros((2, 2)), points={"a": 0, "b": 1})
        for stiffness, expected in ((math.inf, [-1.5, -1.5]), (100.0, [-4.0, 0.0])):
            bump = UnilateralContact("bump", {"b": 1.0, "a": -1.0}, 1.0, stiffness)
            run = simulate(MultiPhiModel(structure, [bump], modes="all"), 5.0, velocity=[0.0, -2.0])
            velocity = run.velocity(5.0)
            assert_allclose(np.array([1.0, 3.0]) @ velocity, -6.0, rtol=1e-12)
            if math.isinf(stiffness):
                assert_allclose(velocity, expected, rtol=1e-12)
            else:  # elastic: relative velocity reversed
                assert_allclose(velocity, [-3.0, -1.0], rtol=1e-9)

    def test_two_sided_gap_without_damping_bounces_for_ever_between_springs(self):
        walls = [stop("m0", 1.0, 50.0, "floor"), stop({"m0": -1.0}, 1.0, 50.0, "ceiling")]
        m = MultiPhiModel(chain(1), walls, modes="all")
        run = simulate(m, 200.0, velocity=[3.0])
        assert_allclose(run.energy(200.0), 4.5, rtol=1e-11)
        floor, ceiling = run.contact_intervals("floor"), run.contact_intervals("ceiling")
        assert len(floor) > 40
        assert abs(len(floor) - len(ceiling)) <= 1
        lengths = np.diff(floor[:-1])[:, 0]
        assert_allclose(lengths, lengths[0], rtol=1e-9)

    def test_quick_bounces_between_stiff_walls_are_no_chatter(self):
        """Hundreds of events in one period of the open level, none too fast for the closed ones."""
        walls = [stop("m0", 1e-9, 1e3, "floor"), stop({"m0": -1.0}, 1e-9, 1e3, "ceiling")]
        run = simulate(MultiPhiModel(chain(1), walls, "all"), 50.0, velocity=[1.0])
        assert run.status == "ok"
        assert len(run.events) > 900
        assert_allclose(run.energy(50.0), 0.5, rtol=1e-10)

    def test_more_events_than_the_modes_can_follow_are_a_failure_with_its_cause(self, monkeypatch):
        monkeypatch.setattr(chatter, "EVENTS_PER_PERIOD", 1.5)
        run = simulate(oscillator(gap=0.0, contact=8.0), 1000.0, displacement=[1.0])
        assert run.status == "failed"
        assert "chatter: 200 events in" in run.message
        assert run.t_end < 1000
        assert_allclose(run.energy(run.t_end), 4.0, rtol=1e-10)


class TestNotANumber:
    def test_an_overridden_frequency_that_is_none_is_a_failed_run(self):
        m = MultiPhiModel(chain(2), [stop()], "all", {(): LevelOverride([math.nan])})
        run = simulate(m, 1.0, velocity=[1.0, 0.0])
        assert run.status == "failed"
        assert "finite" in run.message
        assert run.message.startswith("at t = 0")


def test_a_closed_rigid_contact_never_pulls_whatever_others_did_at_its_instant():
    """Seeds of a random campaign in which a contact that had just closed was left with a negative reaction."""
    for number in (3559, 8999, 9045, 9361, 9920, 10099):
        case = built(recipe_of(number))
        given = case.displacement, case.velocity, case.loads
        assert not complaints(simulate(case.model, case.t_end, *given), case.loads, given[:2])


@pytest.mark.parametrize(
    "number",
    [
        *(20525, 22275, 30128, 30213),  # a spring faces a rigid contact at its place
        7307,  # coupled damping beside a spring of 1e9 N/m
        *(19823, 26183),  # a soft mass under its weight on stops
        *(25121, 25382, 23853, 23981),  # redundant rigid contacts
        *(23776, 4338),  # two stops without clearance, one of them twice
        *(25377, 20023),  # redundant, and not, under a load on damped rigid-body motion
        *(11953, 56157),  # contacts that fall to zero soon after each other, their gaps small differences
        47885,  # a varying load on the softest of a level's modes, all of which are kept
        *(6001852, 6003690),  # springs of up to 3e7 N/m at a start without a gap beside a soft support
        3009722,  # a truncated model's reaction begins below zero by 2e-14 of its terms, after ever shorter bounces
        1369299,  # a rigid contact that closes by its third derivative, beside others
        1394956,  # a mass that damping pulls away from its stop
        *(2000196, 2100897),  # a spring and a rigid contact at one place, on the same side and on opposite sides
    ],
)
def test_what_random_cases_found(number):
    """Seeds of a random campaign: energy out of round-off, or contacts that depend on each other."""
    case = built(recipe_of(number))
    run = simulate(case.model, case.t_end, case.displacement, case.velocity, case.loads)
    assert run.status == "ok", run.message
    assert not complaints(run, case.loads, (case.displacement, case.velocity), exact=1e-7)


class TestRedundantContacts:
    """Of contacts that follow from each other a set that is independent carries all: the motion knows no difference."""

    def test_a_stop_twice_is_one_stop(self):
        once = MultiPhiModel(chain(3), [stop(gap=0.1)], "all")
        twice = MultiPhiModel(chain(3), [stop(gap=0.1), stop(gap=0.1, name="twin")], "all")
        one, two = (simulate(m, 30.0, velocity=[-1.0, 0.3, 0.2]) for m in (once, twice))
        t = np.linspace(0, 30, 200)
        assert two.status == "ok"
        assert len(one.events) == 8
        assert_allclose(two.displacement(t), one.displacement(t), atol=1e-11)
        assert np.min(two.gap("twin", t)) > -1e-12

    def test_stops_on_both_sides_without_clearance_hold_like_a_clamp(self):
        """One of them is closed at a time, the other without a force; the reaction changes sides."""
        above = UnilateralContact("above", {"m0": -1.0}, 0.0)
        m = MultiPhiModel(chain(2), [stop(gap=0.0, name="below"), above], "all")
        run = simulate(m, 20.0, velocity=[0.0, 1.0])
        t = np.linspace(0, 20, 101)
        assert run.status == "ok"
        assert_allclose(run.displacement(t)[0], 0, atol=1e-13)
        assert_allclose(run.displacement(t)[1], np.sin(t), atol=1e-12)
        assert {event.contact for event in run.events} == {"below", "above"}


@pytest.mark.parametrize(
    ("n", "seed"), [(3, 3), (3, 6), (3, 7), (4, 9), (4, 19), (7, 5), (7, 9), (7, 11), (7, 13), (7, 20)]
)
def test_between_a_rigid_and_a_compliant_stop_without_play_a_body_goes_from_one_to_the_other(n, seed):
    """The rigid one lets go where its force, and with it the acceleration, is zero: the next derivative decides.

    In the level of the other one a stiff mode has the round-off of the modes that it is made of, and accelerates.
    """
    stops = [UnilateralContact("above", "m0", 0.0), UnilateralContact("below", {"m0": -1.0}, 0.0, stiffness=1e3)]
    model = MultiPhiModel(chain(n), stops, modes="all")
    run = simulate(model, 20.0, velocity=np.random.default_rng(seed).normal(size=n))
    assert run.status == "ok", run.message
    t = np.linspace(0, 20, 401)
    assert len(run.contact_intervals("above")) >= 2
    assert np.min(run.gap("above", t)) > -1e-12
    assert np.min(run.contact_force("below", t)) > -1e-10
    assert abs(run.ledger.residual) < 1e-11 * run.ledger.initial
