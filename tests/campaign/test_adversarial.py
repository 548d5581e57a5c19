"""Hard random cases: what must hold of every run, laws of contact, and equivalences of two routes to one answer.

The cases are plain scenes (campaign_scenes/plain.py). An equivalence is asked for until the two runs' events part,
which in a sensitive case they do: a start nudged by round-off then parts from both.
"""

import dataclasses
import math

import numpy as np
import pytest
from campaign_judge import reordered
from campaign_scenes.plain import CHOICES, Recipe, built, cases, recipe_of
from campaign_scenes.units import in_units
from hypothesis import given, settings
from hypothesis import strategies as st
from lawful import complaints
from random_campaign import judged, main

from multiphi_exudyn import ConstantLoad, simulate
from multiphi_exudyn.time.segments import Segments

DISTINCT = ("chain", "free chain", "dense", "wide")  # frequencies: of repeated ones a truncated basis may keep any
FEW_EVENTS = 30  # up to which two routes are compared: later round-off has grown
CLOSE = 1e-7  # of the largest displacement: two routes after FEW_EVENTS events
EXACT = 1e-7  # of the terms of a law: cases with forces of 1e9 N/m beside motions of 1e-8 m
SMALLEST = 1e-6  # m: displacements that are less are round-off in cases whose sizes are about 1

FOUND = {
    "a contact that leaves is armed while another one is": Recipe(
        402, "wide", 2, "none", 4, "mixed", "zero", "rows", "all", "touching", "gravity"
    ),
    "two walls at rest": Recipe(49, "chain", 3, "heavy", 3, "rigid", "small", "facing", "few", "static", "point"),
    "every mode overdamped and coupled": Recipe(
        12, "free dense", 2, "given", 3, "rigid", "preload", "above", "all", "rest", "point"
    ),
    "a contact that no kept mode moves": Recipe(
        197, "unconnected", 7, "heavy", 4, "mixed", "preload", "between", "half", "striking", "none"
    ),
    "no stiffness at all": Recipe(
        88, "free dense", 2, "heavy", 3, "mixed", "mixed", "mixed", "few", "striking", "point"
    ),
    "signals that have all but decayed": Recipe(
        2184, "unconnected", 3, "heavy", 4, "mixed", "zero", "above", "one", "moving", "none"
    ),
    "a held contact beside another one": Recipe(
        286, "dense", 3, "modal", 4, "mixed", "zero", "mixed", "all", "striking", "point"
    ),
    "stiff springs beside each other, one in preload": Recipe(
        4970, "repeated", 3, "none", 3, "compliant", "preload", "above", "half", "random", "none"
    ),
    "a soft spring beside a stiff one on a body that hardly anything holds": Recipe(
        5656, "free dense", 3, "none", 3, "compliant", "zero", "below", "all", "static", "gravity"
    ),
    "little energy far from rest": Recipe(
        3718, "unconnected", 6, "heavy", 3, "compliant", "zero", "between", "all", "static", "gravity"
    ),
    "every segment starts at zero": Recipe(
        15520, "repeated", 1, "rayleigh", 2, "mixed", "zero", "rows", "all", "leaving", "none"
    ),
    "a contact strikes at 1e-7 of the speed beside others at rest": Recipe(
        21529, "free chain", 5, "none", 4, "rigid", "preload", "rows", "all", "rest", "gravity"
    ),
    "two stops at one place, and truncation that brings back who opens": Recipe(
        1058536, "unconnected", 6, "dashpot", 2, "rigid", "zero", "above", "half", "touching", "point"
    ),
    "an impact that leaves no motion at all": Recipe(
        1058604, "free dense", 3, "none", 2, "mixed", "preload", "above", "few", "random", "none"
    ),
    "a start inside a compliant contact by 1e-12 of another one's gap": Recipe(
        1062303, "repeated", 2, "given", 4, "compliant", "mixed", "facing", "few", "static", "none"
    ),
    "a start at rest beside a rest that is far away": Recipe(
        1087402, "unconnected", 6, "none", 3, "compliant", "mixed", "between", "all", "static", "gravity"
    ),
    "a stiff spring at 1e-2 m beside a rigid contact that it nearly opens": Recipe(
        1112755, "repeated", 3, "given", 3, "mixed", "zero", "rows", "all", "static", "none"
    ),
    "a start that leaves its stop at the round-off of a speed": Recipe(
        1057756, "free chain", 1, "dashpot", 3, "rigid", "mixed", "mixed", "all", "touching", "point"
    ),
    "a contact that hardly holds a body": Recipe(
        1085108, "free dense", 6, "modal", 4, "mixed", "mixed", "mixed", "all", "static", "point"
    ),
    "a free body that a dashpot hardly slows down": Recipe(
        1162984, "free chain", 7, "dashpot", 4, "mixed", "preload", "mixed", "all", "striking", "none"
    ),
    "a free body struck to a stop by all that its modes leave of it": Recipe(
        1336820, "free dense", 4, "rayleigh", 3, "mixed", "small", "between", "half", "random", "none"
    ),
    "a load that a stop carries without any motion": Recipe(
        16004, "free dense", 3, "heavy", 4, "rigid", "zero", "mixed", "few", "static", "point"
    ),
}


def run_of(case, **changed):
    given_case = dataclasses.replace(case, **changed)
    start = {"displacement": given_case.displacement, "velocity": given_case.velocity}
    return simulate(given_case.model, given_case.t_end, **start, loads=given_case.loads)


def found_in(case):
    """Complaints about the run of a case; where hardly anything moves, about its status alone."""
    run = run_of(case)
    places = run.displacement(np.linspace(0.0, run.t_end, 200)) if run.segments else np.zeros(1)
    if np.max(np.abs(places)) < SMALLEST:
        return [] if run.status == "ok" else [run.message]
    return complaints(run, case.loads, (case.displacement, case.velocity), exact=EXACT)


def nudged(case, run, share):
    """The case with another start, by a share of it; where that is zero, by a share of the speeds of its run."""
    if np.any(case.displacement) or np.any(case.velocity):
        factor = 1 + share
        return dataclasses.replace(case, displacement=factor * case.displacement, velocity=factor * case.velocity)
    speed = float(np.max(np.abs(run.velocity(np.linspace(0, run.t_end, 40)))))
    return dataclasses.replace(case, velocity=share * speed * (-1.0) ** np.arange(len(case.velocity)))


def comparable(run):
    """Whether a run is one that round-off does not change."""
    return run.status == "ok" and len(run.events) <= FEW_EVENTS


def assert_near(found, expected, size=None):
    size = np.max(np.abs(expected)) if size is None else size
    assert np.max(np.abs(np.asarray(found) - expected)) <= CLOSE * max(float(size), SMALLEST)


def sensitive(case, t, factor=1e-12):
    """Whether a start nudged by round-off gives another answer at t."""
    first = run_of(case)
    if not first.segments:
        return True
    runs = [first, run_of(nudged(case, first, factor))]
    if {run.status for run in runs} != {"ok"}:
        return True
    x, y = (run.displacement(t) for run in runs)
    return bool(np.max(np.abs(x - y)) > 1e-2 * CLOSE * np.max(np.abs(x)))


@pytest.mark.parametrize("name", FOUND)
def test_what_went_wrong_once_stays_right(name):
    assert found_in(built(FOUND[name])) == []


RESTS = {
    "falling into a corner": (
        Recipe(15717, "free dense", 2, "modal", 4, "rigid", "mixed", "mixed", "half", "rest", "gravity"),
        8,
    ),
    "rocking between two stops": (
        Recipe(904, "unconnected", 3, "modal", 3, "mixed", "small", "between", "all", "moving", "none"),
        20,
    ),
    "two springs that exchange one mode": (
        Recipe(591, "chain", 3, "dashpot", 2, "compliant", "zero", "rows", "one", "static", "none"),
        20,
    ),
}


@pytest.mark.parametrize("name", RESTS)
def test_what_could_bounce_for_ever_comes_to_rest(name):
    """At speeds of the round-off of an impact it is still one: which contacts are at rest is told by all of them."""
    recipe, most = RESTS[name]
    run = run_of(built(recipe))
    assert run.status == "ok"
    assert 2 <= run.stats.events <= most


def test_a_contact_between_parts_is_blind_to_their_common_motion():
    """What round-off leaves of it in the direction of a contact would be an effective mass of 1e30 kg."""
    case = built(Recipe(22821, "free chain", 5, "modal", 2, "mixed", "zero", "between", "one", "moving", "gravity"))
    assert np.all(case.model.base.directions[0] == 0)


@settings(max_examples=40)
@given(cases())
def test_every_run_keeps_energy_ledger_and_events(case):
    """No exception, energy never gained, the ledger closed, no contact passed unheard."""
    assert found_in(case) == []


@settings(max_examples=20)
@given(cases(law=("compliant", "mixed"), modes="all"))
def test_the_force_of_a_spring_follows_its_law(case):
    run = run_of(case)
    t = np.linspace(0, run.t_end, 2001)
    for contact in run.model.contacts:
        if not contact.rigid:
            law = contact.stiffness * np.maximum(0.0, -run.gap(contact.name, t))
            size = contact.stiffness * (abs(contact.gap) + np.max(np.abs(run.displacement(t))))
            assert np.max(np.abs(run.contact_force(contact.name, t) - law)) <= 1e-9 * size


class TestTwoRoutesOneAnswer:
    @settings(max_examples=12)
    @given(cases(modes="all"), st.floats(0.1, 0.9))
    def test_two_half_runs_are_one_run(self, case, share):
        whole = run_of(case)
        if not comparable(whole) or sensitive(case, whole.t_end):
            return
        first = run_of(case, t_end=share * case.t_end)
        state = {"displacement": first.displacement(first.t_end), "velocity": first.velocity(first.t_end)}
        second = run_of(case, t_end=case.t_end - first.t_end, **state)
        assert_near(second.displacement(second.t_end), whole.displacement(whole.t_end))

    @settings(max_examples=12)
    @given(cases())
    def test_a_mirrored_case_gives_the_mirrored_answer(self, case):
        plain = run_of(case)
        rows = [case.model.structure.row(contact.direction) for contact in case.model.contacts]
        contacts = [dataclasses.replace(c, direction=-row) for c, row in zip(case.model.contacts, rows, strict=True)]
        loads = [dataclasses.replace(load, force=-load.force) for load in case.loads]
        model = dataclasses.replace(case.model, contacts=contacts)
        turned = {"displacement": -case.displacement, "velocity": -case.velocity}
        mirrored = run_of(case, model=model, loads=loads, **turned)
        if comparable(plain) and not sensitive(case, plain.t_end):
            assert_near(-mirrored.displacement(plain.t_end), plain.displacement(plain.t_end))

    @settings(max_examples=12)
    @given(cases(damping="none", law="compliant", modes="all", structure=("chain", "dense", "wide", "repeated")))
    def test_an_undamped_run_between_springs_runs_back_to_its_start(self, case):
        forth = run_of(case)
        if not comparable(forth) or sensitive(case, forth.t_end):
            return
        end = {"displacement": forth.displacement(forth.t_end), "velocity": -forth.velocity(forth.t_end)}
        if sensitive(dataclasses.replace(case, **end), forth.t_end):
            return
        back = run_of(case, **end)
        size = np.max(np.abs(forth.displacement(np.linspace(0, forth.t_end, 50))))
        assert_near(back.displacement(back.t_end), case.displacement, size)

    @settings(max_examples=12)
    @given(
        cases(structure=DISTINCT, damping=("none", "given", "rayleigh")),
        st.integers(0, 2**31),
    )
    def test_permuted_coordinates_give_the_permuted_answer(self, case, seed):
        plain = run_of(case)
        order = np.random.default_rng(seed).permutation(case.model.structure.n)
        permuted = run_of(reordered(case, order))
        if comparable(plain) and not sensitive(case, plain.t_end):
            assert_near(permuted.displacement(plain.t_end), plain.displacement(plain.t_end)[order])

    @settings(max_examples=12)
    @given(
        cases(structure=DISTINCT, damping=("none", "given")), st.sampled_from([1e-3, 1e3]), st.sampled_from([1e-3, 1e6])
    )
    def test_other_units_give_the_scaled_answer(self, case, length, mass):
        """Masses in another unit, lengths in another one: forces scale with both, times with neither."""
        plain = run_of(case)
        scaled = simulate(*in_units(case, 1.0, length, mass))
        if comparable(plain) and not sensitive(case, plain.t_end):
            assert_near(scaled.displacement(plain.t_end) / length, plain.displacement(plain.t_end))

    @settings(max_examples=12)
    @given(cases(structure=("chain", "dense", "wide", "repeated"), load="none", modes="all"), st.floats(-3, 3))
    def test_a_constant_load_is_a_shifted_rest(self, case, force):
        """x = x_s + z: z moves freely where K x_s = f and every gap is larger by h.x_s."""
        structure = case.model.structure
        shift = np.linalg.solve(structure.stiffness, force * structure.row("m0"))
        contacts = [
            dataclasses.replace(c, gap=c.gap - float(structure.row(c.direction) @ shift)) for c in case.model.contacts
        ]
        model = dataclasses.replace(case.model, contacts=contacts)
        loaded_start = case.displacement + shift
        free = run_of(case)
        if comparable(free) and not sensitive(case, free.t_end):
            loads = (ConstantLoad("m0", force),)
            loaded = run_of(case, model=model, displacement=loaded_start, loads=loads)
            size = np.max(np.abs(shift)) + np.max(np.abs(free.displacement(free.t_end)))
            assert_near(loaded.displacement(free.t_end) - shift, free.displacement(free.t_end), size)


@settings(max_examples=10)
@given(st.integers(0, 2**31), st.integers(2, 6))
def test_a_rigid_stop_that_is_pressed_is_the_limit_of_stiffness(seed, n):
    """Without an impact the difference falls as 1 / k; after one it does not, of which the rigid stop keeps nothing."""
    case = built(Recipe(seed, "chain", n, "none", 1, "rigid", "small", "rows", "all", "rest", "none"))
    press = {"m0": -1e3}
    (contact,) = (dataclasses.replace(c, direction="m0") for c in case.model.contacts)
    speed = np.where(np.arange(n) == 0, 0.0, case.model.structure.row("m0") @ np.ones(n) + np.arange(n) / n)
    ends, t = [], np.linspace(0, 1, 50)
    for stiffness in (math.inf, 1e6, 1e8):
        model = dataclasses.replace(case.model, contacts=[dataclasses.replace(contact, stiffness=stiffness)])
        start, loads = model.static_equilibrium(press), (ConstantLoad("m0", press["m0"]),)
        run = run_of(case, model=model, t_end=1.0, displacement=start, velocity=speed, loads=loads)
        assert [event.kind for event in run.events if event.time > 0] == []
        ends.append(run.displacement(t))
    soft, hard = (np.max(np.abs(end - ends[0])) for end in ends[1:])
    assert 0 < hard < 0.02 * soft


class TestTheChecksSee:
    """A check that cannot fail is none: each of them is shown a wrong run."""

    CASE = Recipe(5, "chain", 3, "none", 1, "compliant", "small", "below", "all", "moving", "none")

    def test_a_missed_event(self):
        run = run_of(built(self.CASE))
        through = Segments([dataclasses.replace(run.segments[0], end=run.t_end)])
        assert any("inside its stop" in text for text in complaints(dataclasses.replace(run, segments=through)))

    def test_an_event_that_comes_late(self):
        run = run_of(built(self.CASE))
        first, second, *others = run.segments
        later = first.end + 1e-6
        moved = [dataclasses.replace(first, end=later), dataclasses.replace(second, start=later), *others]
        assert any("inside its stop" in text for text in complaints(dataclasses.replace(run, segments=Segments(moved))))

    def test_energy_out_of_nothing(self):
        run = run_of(built(self.CASE))
        first, *others = run.segments
        weaker = dataclasses.replace(first, rows=0.9 * first.rows)
        found = complaints(dataclasses.replace(run, segments=Segments([weaker, *others])))
        assert any(text.startswith("energy rises") for text in found), found


class TestCampaign:
    def test_a_case_is_its_number(self):
        assert recipe_of(7) == recipe_of(7) != recipe_of(8)
        pair = [built(recipe_of(7)) for _ in range(2)]
        assert np.array_equal(pair[0].velocity, pair[1].velocity)
        assert {recipe_of(k).structure for k in range(100)} == set(CHOICES["structure"])

    @pytest.mark.parametrize("number", [2316, 4785])
    def test_a_start_at_rest_is_right_too(self, number):
        """Two hundred events at the rate of one spring of 1e8 N/m and more: round-off grows to 1e-6."""
        case = built(recipe_of(number))
        assert not np.any(case.displacement)
        assert not np.any(case.velocity)
        assert judged("plain", number)[0] == [("ok", "")]

    @pytest.mark.parametrize(
        "number",
        [
            30592,  # at rest on a rigid stop when a level begins in which no other mode moves it
            60230,  # two stops let go at nearly one instant, one of which has a twin
            *range(6),
        ],
    )
    def test_cases_that_were_hard_are_right(self, number):
        assert judged("plain", number)[0] == [("ok", "")]

    @pytest.mark.parametrize("number", [1933, 109663])
    def test_round_off_of_an_impact_is_rest(self, number):
        """A plastic impact leaves 1e-16 of a speed: bounces of it, or of a gap that faces the stop, never end."""
        assert judged("plain", number)[0] == [("ok", "")]

    def test_a_reaction_has_the_round_off_of_a_level_whose_equilibrium_is_far_away(self):
        """While it is open a soft spring would hold 19 N at 7.4 m; closed, a stiff one turns 4e-16 m into 1e-8 N."""
        assert judged("plain", 7014936)[0] == [("ok", "")]

    def test_goes_on_where_it_was(self, tmp_path, capsys):
        arguments = ["--processes", "1", "--out", str(tmp_path / "chunks"), "--count"]
        assert main([*arguments, "2"]) == 0
        assert main([*arguments, "2"]) == 0
        assert capsys.readouterr().out.count("2 cases") == 2
        assert len((tmp_path / "chunks").read_text("utf-8").splitlines()) == 1

    def test_names_an_exception(self, monkeypatch):
        def broken(*given, **named):
            raise ZeroDivisionError("float division by zero")

        monkeypatch.setattr("campaign_judge.mp.simulate", broken)
        assert judged("plain", 3)[0] == [("failure: exception", "ZeroDivisionError: float division by zero")]

    def test_names_a_run_that_does_not_end(self, monkeypatch):
        def endless(*given, **named):
            while True:
                pass

        monkeypatch.setattr("campaign_judge.mp.simulate", endless)
        monkeypatch.setattr("random_campaign.LONGEST", 0.2)
        assert judged("plain", 3)[0] == [("failure: endless", "not finished after 0.2 s")]
