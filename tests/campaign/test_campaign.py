"""The campaign of what users bring: reproducible scenes, brute force that is right, judges that see what is broken."""

import dataclasses
import math

import brute_force as bf
import campaign_judge
import numpy as np
import pytest
import random_campaign
from campaign_scenes import KINDS, numbers, scene_of
from random_campaign import differences, judged, main

import multiphi_exudyn as mp

LIGHT = dict.fromkeys(KINDS, 3) | {
    "harmonic": 10,
    "sweeps": 4,
    "several": 4,
    "viscous": 6,
    "tables": 2,
    "functions": 4,
    "units": 0,
    "moving stops": 4,
    "moving bases": 4,
    "rigid": 0,
    "laws": 6,
    "assembled": 7,
    "clamps": 0,
    "restarts": 10,
    "bounded": 4,
    "truncated": 0,
    "friction": 2,
    "friction blocks": 5,
    "jenkins": 11,
    "friction loads": 1,
    "friction contacts": 6,
    "friction impacts": 0,
    "contact friction": 9,
    "rigid friction": 8,
    "friction limits": 1,
    "friction free": 5,
    "friction units": 9,
    "friction redundant": 8,
    "lattice": 3,
    "nearly free": 5,
    "zero gaps": 3,
    "at events": 3,
    "dampers": 3,
    "digits": 3,
    "free on damped stops": 0,
    "slip at the stop": 0,
    "spring across a floor": 0,
    "cancelled spring": 0,
    "body statics": 0,
    "body unmatched": 0,
    "joints": 0,
    "racks": 0,
    "strings": 0,
    "knots": 0,
    "landings": 0,
}  # quick ones in which something happens; random_campaign.py runs many


@pytest.mark.parametrize("kind", KINDS)
def test_a_scene_of_every_kind_is_right(kind):
    assert [verdict for verdict, _ in judged(kind, LIGHT[kind])[0]] == ["ok"]


HARD = [
    ("sampled", 3, "a load falls in a millionth of the run: its terms are moved on, not made anew"),
    ("moving stops", 11, "a level is first entered within an interval of a load"),
    ("moving bases", 112, "the last step of a body in Exudyn ends under the load that the run ends with"),
    ("moving redundant", 2062, "a dip is seen with shorter steps of brute force alone"),
    ("rigid", 2176, "a body that passes its rest is not taken for one that somebody has moved"),
    ("redundant", 412, "two stops at 1e-5 rad, one held, one struck: the held one is let go, however slowly"),
    ("truncated", 3030, "an impulse that is round-off closes no contact"),
    ("units", 6, "channels whose numbers outweigh the speeds of the structure hide no impact"),
    ("lattice", 3323, "elastic bounces that friction damps come to rest"),
    ("lattice", 4323, "the same beside a force law"),
    ("lattice", 6708, "of two contacts at one place none pulls in their last bounce"),
    ("friction", 210116, "resonance: the speed at a turn is round-off of what it has grown to"),
    ("friction contacts", 210145, "a spring at its limit goes back for less than brute force looks ahead"),
    ("friction free", 210145, "a spring at its limit that a block lets go gently: beyond it by round-off for long"),
    ("friction free", 142102, "a free body that a load moves from rest is not taken for one that somebody has moved"),
    ("friction impacts", 12108, "a rigid contact lets go of a block that turns, and which then sticks"),
    ("friction impacts", 12038, "two blocks could fall from their static limits: the one that turns falls first"),
    ("friction loads", 12146, "one block falls, which leaves the other within its static limit"),
    ("friction loads", 1200025, "7 N, which would move it by 0.6 m, slip it by 3e-8 m: work is a difference of 4 J"),
    ("friction units", 12123, "a block sticks along a stop: only the sum of their impulses is known"),
    ("friction units", 20014, "in units of 2^40 s a speed is no round-off of a displacement"),
    ("friction units", 150071, "impacts without end bring friction elsewhere to rest, within its static limit"),
    ("friction redundant", 3020, "all slip accelerations cancel: round-off does not decide who sticks"),
    ("friction redundant", 20003, "the same, without a spring"),
    ("friction redundant", 450047, "of two at their limits but for round-off the one with a static limit sticks"),
    ("contact friction", 162068, "a spring falls from its static limit and sticks again"),
    ("rigid friction", 162141, "impacts without end bring a block elsewhere to rest, which all of them move"),
    ("rigid friction", 190263, "a slip between bounces is shorter than they are"),
    ("rigid friction", 227, "a contact sticks on its stop, with much friction, while another strikes"),
    ("rigid friction", 271, "one that has just left its stop by less than can be seen is struck with the next"),
    ("rigid friction", 665, "one is carried along by its belt while another slides"),
]


@pytest.mark.parametrize(("kind", "number", "why"), HARD, ids=[f"{kind} {number}" for kind, number, _ in HARD])
def test_a_scene_that_was_hard_is_right(kind, number, why):
    assert [verdict for verdict, _ in judged(kind, number)[0]] == ["ok"], why


def test_round_off_of_a_scene_at_rest_is_no_answer_that_processors_could_differ_in():
    """At its limit exactly, nothing moves: displacements are 1e-17."""
    found, (status, events, values) = judged("friction limits", 5000014)
    assert (found, status, events) == ([("ok", "")], "ok", 0)
    assert len(values) > 20
    assert not any(values)


def test_what_friction_holds_does_not_move_but_for_round_off_of_the_forces_on_it():
    """1e-16 m, which a run in two parts has otherwise, are no motion where the loads could move it by 1e-2 m."""
    scene = scene_of("friction redundant", 210028)
    assert np.max(np.abs(campaign_judge.native(scene).displacement)) < 1e-14
    assert judged("friction redundant", 210028)[0] == [("ok", "")]


def test_a_contact_that_closes_and_opens_at_once_has_been_struck():
    """Where nothing was struck there is no event: round-off made such pairs, another number of them on every kernel."""
    (run,) = campaign_judge.native(scene_of("clamps", 3019)).runs
    impulses = {}
    for event in run.events:
        impulses.setdefault((event.time, event.contact), []).append(event.impulse)
    assert all(max(pair) > 1e-12 for pair in impulses.values() if len(pair) > 1)


@pytest.mark.parametrize(
    ("kind", "number", "verdict"),
    [
        ("contact friction", 162054, "told"),
        ("rigid friction", 190156, "told"),  # an impact of two contacts that has three answers
        ("rigid friction", 200385, "told"),  # one turns while it pushes another over its static limit
        ("jenkins", 1, "failure: wrong"),
    ],
)
def test_a_run_may_differ_where_it_says_that_it_is_not_unique(monkeypatch, kind, number, verdict):
    found = [("failure: wrong", "another motion")], (0.0, 0.0)
    monkeypatch.setattr(campaign_judge, "_compared", lambda scene, motion: found)
    assert [said for said, _ in judged(kind, number)[0]] == [verdict]


def test_a_scene_comes_from_its_kind_and_number_alone():
    first, again, other = scene_of("rigid", 4), scene_of("rigid", 4), scene_of("rigid", 5)
    assert np.array_equal(first.velocity, again.velocity)
    assert first.t_end == again.t_end != other.t_end
    assert numbers(("rigid", "free"), 3, 3) == [("rigid", 3), ("free", 3), ("rigid", 4)]


class TestBruteForce:
    """Against motions that are known exactly."""

    def test_strikes_and_leaves_a_rigid_stop(self):
        """Mass 1, spring 1, x' = -1 at x = 0 over a stop at -0.5: struck at 30 degrees, then at rest on it."""
        system = bf.System(np.eye(1), np.zeros((1, 1)), np.eye(1), [bf.Stop(np.ones(1), 0.5)])
        end = math.pi / 6 + 1.0
        answer = bf.solved(system, np.zeros(1), -np.ones(1), np.array([0.5, math.pi / 6 + 0.5, end]))
        assert answer.displacement[0] == pytest.approx(
            [-math.sin(0.5), -0.5 * math.cos(0.5), -0.5 * math.cos(1.0)], abs=1e-13
        )
        assert answer.impulse[0] == pytest.approx(math.cos(math.pi / 6), abs=1e-13)
        assert answer.impact == pytest.approx(0.375, abs=1e-13)

    def test_bounces_until_it_rests(self):
        """A ball from 1 m, e .5: it rests after sqrt(2 h / g) (1 + e) / (1 - e)."""
        floor = bf.Stop(np.ones(1), 0.0, restitution=0.5)
        system = bf.System(np.eye(1), np.zeros((1, 1)), np.zeros((1, 1)), [floor], constant=np.array([-9.81]))
        answer = bf.solved(system, np.ones(1), np.zeros(1), np.array([1.0, 1.354570922957, 2.0]))
        first = math.sqrt(2 / 9.81)
        second = 1.0 - 2 * first
        height = 0.25 * 9.81 * first * second - 9.81 * second**2 / 2
        assert answer.displacement[0] == pytest.approx([height, 0.0, 0.0], abs=1e-10)
        assert answer.impact == pytest.approx(9.81, rel=1e-10)

    @pytest.mark.parametrize("seed", range(8))
    def test_ends_bounces_of_any_height_and_restitution(self, seed):
        """Rows and gaps that are no round numbers: a bounce shorter than the first look after it was begun for ever."""
        random = np.random.default_rng(seed)
        restitution, gap, row = random.uniform(0.1, 0.5), random.uniform(0.01, 0.3), random.uniform(0.5, 2)
        floor = bf.Stop(np.array([row]), gap, restitution=restitution)
        system = bf.System(np.eye(1), np.zeros((1, 1)), np.zeros((1, 1)), [floor], constant=np.array([-9.81]))
        answer = bf.solved(system, np.ones(1), np.zeros(1), np.array([5.0]))
        assert answer.displacement[0] == pytest.approx([-gap / row], rel=1e-12)
        assert answer.impact == pytest.approx(9.81 * (1 + gap / row), rel=1e-10)

    @pytest.mark.parametrize("restitution", [0.15, 0.5, 0.8])
    def test_rubs_as_long_as_it_bounces(self, restitution):
        """Slid along the floor from 1 m: in the end at rest across it, which has pushed with m g t, and mu m g t along.

        The last impacts were taken away without their friction, 1e-7 of the speeds.
        """
        floor = bf.Stop(np.array([0.0, 1.0]), 0.0, restitution=restitution)
        rough = bf.Slider(np.array([1.0, 0.0]), 0.3, 0.3, contact=0)
        system = bf.System(
            np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), [floor], sliders=[rough], constant=np.array([0.0, -9.81])
        )
        end = math.sqrt(2 / 9.81) * (1 + restitution) / (1 - restitution)
        times = np.array([end + 0.1, end + 0.4])
        answer = bf.solved(system, np.array([0.0, 1.0]), np.array([40.0, 0.0]), times)
        assert answer.velocity[0] == pytest.approx(40.0 - 0.3 * 9.81 * times, rel=1e-12)
        assert np.max(np.abs(answer.velocity[1])) < 1e-12

    def test_three_balls_that_touch_share_an_impact(self):
        """e 1, v- = (1, 0, 0): v+ = (-1, 2, 2) / 3."""
        stops = [bf.Stop(np.array(row), 0.0, restitution=1.0) for row in ([-1.0, 1.0, 0.0], [0.0, -1.0, 1.0])]
        system = bf.System(np.eye(3), np.zeros((3, 3)), np.zeros((3, 3)), stops)
        answer = bf.solved(system, np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.5]))
        assert answer.velocity[:, 0] == pytest.approx([-1 / 3, 2 / 3, 2 / 3], abs=1e-13)
        assert answer.impact == pytest.approx(0.0, abs=1e-13)

    def test_swings_on_a_compliant_stop(self):
        """Mass 1 without a spring against 4 N/m: half a period of 2 rad/s, and back."""
        system = bf.System(np.eye(1), np.zeros((1, 1)), np.zeros((1, 1)), [bf.Stop(np.ones(1), 0.0, 4.0)])
        answer = bf.solved(system, np.zeros(1), -np.ones(1), np.array([math.pi / 4, math.pi / 2 + 1.0]))
        assert answer.displacement[0] == pytest.approx([-0.5, 1.0], abs=1e-13)
        assert answer.impulse[0] == pytest.approx(2.0, abs=1e-13)

    def test_sees_a_short_contact_wherever_its_steps_begin(self):
        """x = cos t dips a part of a step long below a stop at t = pi, from many starts before it."""
        system = bf.System(np.eye(1), np.zeros((1, 1)), np.eye(1), [bf.Stop(np.ones(1), 1 - 1e-4, 1.0)])
        found = [
            len(bf.solved(system, np.array([math.cos(start)]), -np.array([math.sin(start)]), np.array([6.0])).events)
            for start in np.linspace(0.2, 3, 94)
        ]
        assert set(found) == {2}

    def test_follows_a_resonant_load(self):
        """x'' + x = cos t from rest: x = t sin(t) / 2."""
        load = (np.ones(1), bf.Course(np.cos))
        system = bf.System(np.eye(1), np.zeros((1, 1)), np.eye(1), loads=[load])
        times = np.linspace(0.1, 20, 30)
        answer = bf.solved(system, np.zeros(1), np.zeros(1), times)
        assert np.max(np.abs(answer.displacement[0] - times * np.sin(times) / 2)) < 1e-12

    def test_rests_on_a_stop_that_carries_it_away(self):
        """A free mass pressed with 1 N on a stop whose acceleration is at most 0.5 m/s2: it never leaves it."""
        way = bf.Course(lambda t: 0.5 * (1 - np.cos(t)), lambda t: 0.5 * np.sin(t), lambda t: 0.5 * np.cos(t), step=0.3)
        system = bf.System(
            np.eye(1), np.zeros((1, 1)), np.zeros((1, 1)), [bf.Stop(np.ones(1), 0.0, course=way)], constant=-np.ones(1)
        )
        times = np.linspace(0.1, 6, 7)
        answer = bf.solved(system, np.zeros(1), np.zeros(1), times)
        assert np.max(np.abs(answer.displacement[0] - 0.5 * (1 - np.cos(times)))) < 1e-12
        assert answer.impulse[0] == pytest.approx(times[-1] + 0.5 * math.sin(times[-1]), abs=1e-12)


class TestBruteForceOfFriction:
    """Against motions that are known exactly."""

    ONE = np.ones(1)

    def block(self, stiffness, *sliders, **more):
        return bf.System(np.eye(1), np.zeros((1, 1)), stiffness * np.eye(1), sliders=sliders, **more)

    def test_a_block_loses_as_much_in_every_half_cycle_until_it_rests(self):
        """m 1, k 4, F .1 from x0 .33: it turns at .33 - .05 n and rests at .02 after seven half cycles."""
        times = np.r_[math.pi / 2 * np.arange(1, 8), 20.0]
        answer = bf.solved(self.block(4.0, bf.Slider(self.ONE, 0.1, 0.1)), 0.33 * self.ONE, 0 * self.ONE, times)
        turns = [(0.33 - 0.05 * n) * (-1) ** n for n in range(1, 8)]
        assert answer.displacement[0] == pytest.approx([*turns, 0.02], abs=1e-14)
        assert answer.slipped == pytest.approx(sum(2 * (0.33 - 0.05 * n) - 0.05 for n in range(7)), abs=1e-13)

    def test_a_block_on_a_belt_sticks_and_slips_with_its_period(self):
        """m 1, k 25, V .3, limits 2 and 3.5."""
        belt = bf.Slider(self.ONE, 2.0, 3.5, velocity=0.3)
        answer = bf.solved(self.block(25.0, belt), 0 * self.ONE, 0 * self.ONE, np.array([12.0]))
        slips = [t for t, _, state in answer.events if state == "-"]
        assert np.diff(slips) == pytest.approx(1.3424777960769378, rel=1e-13)

    def test_a_spring_in_series_gives_way_first(self):
        """A free mass of 1 m/s on a spring of 25 N/m and 2 N: v^2 is 1 - 25 .08^2 where it slips, for v^2 / 4 m."""
        ring = bf.Slider(self.ONE, 2.0, 2.0, stiffness=25.0)
        answer = bf.solved(self.block(0.0, ring), 0 * self.ONE, self.ONE, np.array([10.0]))
        assert [event[2] for event in answer.events] == ["+", "stick"]
        assert answer.slipped == pytest.approx(0.21, abs=1e-13)

    def test_two_blocks_that_are_one_carry_their_limits_together(self):
        """Limits .06 and .04 on one mass: the free decay of .1."""
        sliders = bf.Slider(self.ONE, 0.06, 0.06), bf.Slider(-self.ONE, 0.04, 0.04)
        answer = bf.solved(self.block(4.0, *sliders), 0.33 * self.ONE, 0 * self.ONE, np.array([20.0]))
        assert answer.displacement[0] == pytest.approx([0.02], abs=1e-13)

    @pytest.mark.parametrize("held", [1e-6, 1e-4])
    def test_a_block_sticks_for_a_moment_below_its_static_limit(self, held):
        """Limits .5 and 1, a load that grows by .5 N/s and brings it to rest at 1 s, ``held`` s before it is 1 N.

        It stepped over the moment, and slid back at once.
        """

        def load(t):
            return 1.0 + 0.5 * (t - 1.0 - held)

        system = self.block(0.0, bf.Slider(self.ONE, 0.5, 1.0), loads=[(-self.ONE, bf.Course(load, step=0.1))])
        speed = 0.5 + (load(0.0) + load(1.0)) / 2
        turns = 0.5 * (0.5 + load(0.0)) + 0.5 / 3  # x of x'' = -.5 - load at 1 s
        after = 1.0 - held
        times = np.array([1.0 + held, 2.0])
        answer = bf.solved(system, 0 * self.ONE, speed * self.ONE, times)
        assert answer.displacement[0] == pytest.approx([turns, turns - after**2 / 4 - after**3 / 12], rel=1e-13)
        assert [state for _, _, state in answer.events] == ["stick", "-"]

    def test_a_block_at_rest_slides_from_the_instant_at_which_its_load_jumps(self):
        """Before its time the load was looked at as it had been: nothing moved, for ever at the same instant."""
        for at in np.linspace(0.2, 1.8, 33):
            for load in (lambda t, at=at: np.where(t < at, 0.0, 2.0), lambda t, at=at: np.where(t <= at, 0.0, 2.0)):
                given = [(self.ONE, bf.Course(load, breaks=(at,)))]
                system = self.block(0.0, bf.Slider(self.ONE, 1.0, 1.0), loads=given)
                answer = bf.solved(system, 0 * self.ONE, 0 * self.ONE, np.array([2.0]))
                assert answer.displacement[0, 0] == pytest.approx((2.0 - at) ** 2 / 2, rel=1e-12)
                assert len(answer.events) == 1

    def test_friction_of_a_contact_follows_its_force(self):
        """A block pressed on the ground by its weight and thrown along it: it rests after v^2 / (2 mu g)."""
        floor = bf.Stop(np.array([0.0, 1.0]), 0.0, 1e4)
        slider = bf.Slider(np.array([1.0, 0.0]), 0.3, 0.3, contact=0)
        system = bf.System(
            np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), [floor], sliders=[slider], constant=np.array([0.0, -10.0])
        )
        answer = bf.solved(system, np.array([0.0, -1e-3]), np.array([2.0, 0.0]), np.array([0.5, 1.0]))
        assert answer.displacement[0] == pytest.approx([2 * 0.5 - 1.5 * 0.25, 2.0 / 3], abs=1e-11)

    def test_friction_of_a_rigid_contact_follows_its_reaction(self):
        floor, slider = bf.Stop(np.array([0.0, 1.0]), 0.0), bf.Slider(np.array([1.0, 0.0]), 0.3, 0.3, contact=0)
        system = bf.System(
            np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), [floor], sliders=[slider], constant=np.array([0.0, -10.0])
        )
        answer = bf.solved(system, np.zeros(2), np.array([2.0, 0.0]), np.array([0.5, 1.0]))
        assert answer.displacement[0] == pytest.approx([2 * 0.5 - 1.5 * 0.25, 2.0 / 3], abs=1e-11)
        assert answer.impulse == pytest.approx(10.0)


class TestJudge:
    """An answer that is broken on purpose is told."""

    KIND, NUMBER = "rigid", 0

    def verdict(self):
        return [kind for kind, _ in judged(self.KIND, self.NUMBER)[0]]

    def test_tells_an_event_at_another_time(self, monkeypatch):
        """A stop that stands 1e-5 of its gap elsewhere."""
        simulate = mp.simulate

        def shifted(model, *given, **named):
            contacts = [dataclasses.replace(c, gap=c.gap * (1 + 1e-5)) for c in model.contacts]
            return simulate(dataclasses.replace(model, contacts=contacts), *given, **named)

        monkeypatch.setattr("campaign_judge.mp.simulate", shifted)
        assert "failure: wrong" in self.verdict()

    def test_tells_an_impulse_that_is_lost(self, monkeypatch):
        impulse = mp.Trajectory.contact_impulse
        monkeypatch.setattr(mp.Trajectory, "contact_impulse", lambda *given: 0.999 * impulse(*given))
        assert self.verdict() == ["failure: impulse"]

    @pytest.mark.parametrize(
        ("number", "factor", "told"), [(3, -1.0, "failure: pulls"), (3, 1.001, "failure: force"), (3, 1.0, "ok")]
    )
    def test_tells_a_force_that_pulls_or_is_not_that_of_the_motion(self, monkeypatch, number, factor, told):
        force = mp.Trajectory.contact_force
        monkeypatch.setattr(mp.Trajectory, "contact_force", lambda *given: factor * force(*given))
        monkeypatch.setattr(campaign_judge, "laws_of", lambda *given: [])
        assert [kind for kind, _ in judged("viscous", number)[0]] == [told]

    def test_tells_a_run_that_fails(self, monkeypatch):
        simulate = mp.simulate
        failed = {"status": "failed", "message": "at t = 1 s: chatter: too many"}
        monkeypatch.setattr(
            "campaign_judge.mp.simulate", lambda *g, **n: dataclasses.replace(simulate(*g, **n), **failed)
        )
        assert self.verdict() == ["chatter"]

    def test_tells_energy_that_is_lost(self, monkeypatch):
        monkeypatch.setattr(mp.Ledger, "residual", property(lambda ledger: 1e-6 * ledger.initial))
        assert self.verdict() == ["failure: ledger is open"]

    def test_excuses_no_motion_that_a_nudge_does_not_change(self):
        scene = scene_of(self.KIND, self.NUMBER)
        motion = campaign_judge.native(scene)
        assert not campaign_judge.sensitive(scene, motion, campaign_judge.INSTANTS)


class TestLattice:
    """Scenes of small integers and zeros, judged by the law check alone."""

    def test_draws_what_continuous_numbers_do_not(self):
        scenes = [scene_of("lattice", number) for number in range(200)]
        structures = [scene.model.structure for scene in scenes]
        assert sum(not np.any(structure.stiffness) for structure in structures) > 40  # nothing holds the bodies
        assert sum(structure.damping is not None and np.any(structure.damping) for structure in structures) > 20
        rows = [
            [structure.row(c.direction) for c in s.model.contacts]
            for s, structure in zip(scenes, structures, strict=True)
        ]
        alike = [len(given) > 1 and np.linalg.matrix_rank(given) < len(given) for given in rows]
        assert sum(alike) > 60
        touching = [
            isinstance(c, mp.UnilateralContact) and c.gap + float(c.direction @ s.displacement) == 0
            for s in scenes
            for c in s.model.contacts
        ]
        assert sum(touching) > 60
        assert {type(c) for s in scenes for c in s.model.contacts} == {mp.UnilateralContact, mp.Friction, mp.ForceLaw}

    @pytest.mark.parametrize(
        ("answer", "told"),
        [
            ("contact_force", lambda force: lambda *given, **named: 1.0001 * force(*given, **named)),
            ("acceleration", lambda motion: lambda *given, **named: 1.0001 * motion(*given, **named)),
        ],
    )
    def test_judges_by_the_laws(self, monkeypatch, answer, told):
        number = next(k for k in range(9) if campaign_judge.native(scene_of("lattice", k)).events > 2)
        assert judged("lattice", number)[0] == [("ok", "")]
        monkeypatch.setattr(mp.Trajectory, answer, told(getattr(mp.Trajectory, answer)))
        assert ("failure: equation of motion") in [verdict for verdict, _ in judged("lattice", number)[0]]


class TestKernels:
    """The same cases under several kernels of the linear algebra library."""

    def test_equal_answers_do_not_differ(self):
        other = {"rigid/0": ["ok", 4, [1.0, 2.0 + 1e-9]]}
        assert differences({"a": {"rigid/0": ["ok", 4, [1.0, 2.0]]}, "b": other}) == []

    @pytest.mark.parametrize(
        ("other", "said"),
        [
            (["chatter", 4, [1.0]], "status ok, chatter"),
            (["ok", 6, [1.0, 2.0]], "4 and 6 events"),
            (["ok", 4, [1.0, 2.1]], "answers 0.05 apart, 4 and 4 events"),
        ],
    )
    def test_what_differs_is_told(self, other, said):
        first = {"rigid/0": ["ok", 4, [1.0, 2.0]]}
        assert differences({"a": first, "b": {"rigid/0": other}}) == [f"rigid 0  a and b: {said}"]

    def test_a_kernel_that_does_not_run_is_refused(self, monkeypatch, capsys, tmp_path):
        monkeypatch.setenv("OPENBLAS_CORETYPE", "Abacus")
        with pytest.raises(SystemExit):
            main(["--count", "1", "--out", str(tmp_path / "chunks")])
        assert "the library runs" in capsys.readouterr().err

    def test_the_running_kernel_has_a_name(self):
        assert random_campaign.kernel() != "unknown"
