"""Warnings of an answer: each kind where it is due, with its number, once, and silence where nothing is wrong."""

import dataclasses
import functools
import math
import warnings
from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_structures import chain, random_model, stop

import multiphi_exudyn as mp
from multiphi_exudyn.time.run_warnings import warnings_of
from multiphi_exudyn.time.state import event_table
from multiphi_exudyn.time.truncation import defects
from reference_models.rig import initial_displacement, rig_beam, rig_contact, rig_damping

END = 0.3


@functools.cache
def rig(stiffness):
    structure = mp.planar_beam(rig_beam(), elements=57, damping=rig_damping())
    model = mp.MultiPhiModel(structure, [rig_contact(stiffness)], modes="all")
    bent = model.static_equilibrium({"node3": 1.0})
    return model, bent * initial_displacement() / float(structure.row("node3") @ bent)


def kinds(run):
    return [sentence.split(":")[0] for sentence in run.warnings]


def long_chain(modes):
    """18 masses, a contact far stiffer than the chain at the last one: its mode lies above all others."""
    structure = chain(18, mass=0.5, stiffness=2e4)
    return mp.MultiPhiModel(structure, [stop("m17", 5e-3, 1e6)], modes=modes)


def released(model, **given):
    return mp.simulate(model, 0.5, displacement=3e-3 * np.arange(18.0), velocity=np.zeros(18), **given)


class TestTruncatedContact:
    @pytest.mark.parametrize(
        ("modes", "share"), [(4, 0.8648), (6, 0.3693), (8, 0.2426), (10, 0.0718), (12, 0.0521), (20, 0.01126)]
    )
    def test_the_share_of_the_rig_is_that_of_its_spectrum(self, modes, share):
        """Against the compliance of the full matrices."""
        model, _ = rig(1e6)
        structure = model.structure
        row = structure.row("node2")
        stiffness = structure.stiffness + 1e6 * np.outer(row, row)
        level = dataclasses.replace(model, modes=modes).level(("support",))
        kept = np.sum((row @ level.shapes / level.omega) ** 2)
        expected = 1 - kept / (row @ np.linalg.solve(stiffness, row))
        assert level.static_shares == {"support": pytest.approx(expected, rel=1e-8)}
        assert expected == pytest.approx(share, abs=1e-4)

    def test_a_run_says_which_contact_and_how_much(self):
        run = released(long_chain(17))
        (told,) = (sentence for sentence in run.warnings if sentence.startswith("truncated contact: "))
        assert "'stop' 17 modes leave out 98 %" in told
        assert "truncated contact" not in kinds(released(long_chain("all")))


class TestTruncatedFriction:
    """5 % and more of the force, where few modes hold what sticks; stiff springs and none are alike."""

    def run(self, modes, stiffness):
        beam = mp.planar_beam(rig_beam(), elements=20, damping=rig_damping())
        model = mp.MultiPhiModel(beam, [mp.Friction("ring", "node2", 0.6, stiffness=stiffness)], modes=modes)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return mp.simulate(model, 0.5, loads=[mp.HarmonicLoad("node3", 1.0, 10.0, -math.pi / 2)])

    @pytest.mark.parametrize(
        ("modes", "stiffness", "told"),
        [
            (4, math.inf, True),
            (4, 1e8, True),
            (3, 1e5, True),
            (8, math.inf, False),
            (8, 1e8, False),
            (6, 1e5, False),
            (4, 1e3, False),
            (None, math.inf, False),
            (None, 1e8, False),
        ],
    )
    def test_is_told_where_the_force_is_off(self, modes, stiffness, told):
        run, whole, t = self.run(modes, stiffness), self.run("all", stiffness), np.linspace(0, 0.5, 501)
        true = whole.friction_force("ring", t)
        error = np.linalg.norm(run.friction_force("ring", t) - true) / np.linalg.norm(true)
        assert ("truncated friction" in kinds(run)) == told == (error > 0.03)
        assert "truncated contact" not in kinds(run)


class TestTruncation:
    def test_energy_that_truncation_took_is_said_from_one_per_cent(self):
        model, start = rig(1e6)
        few, many = (mp.simulate(dataclasses.replace(model, modes=r), END, displacement=start) for r in (6, 12))
        lost = sum(e.loss.truncation_kinetic + e.loss.truncation_strain for e in few.events)
        (told,) = (sentence for sentence in few.warnings if sentence.startswith("truncation: "))
        assert float(told.split(", and ")[1].split(" %")[0]) == pytest.approx(100 * lost / few.ledger.initial, rel=0.1)
        assert many.warnings == ()

    @pytest.mark.parametrize("loads", [(), (mp.ConstantLoad("m9", 2.0),)], ids=["free", "static"])
    def test_energy_that_displacements_hardly_show_is_said_alone(self, loads):
        structure = chain(40, mass=0.5, stiffness=2e4, damping=mp.ModalDamping(0.02))
        model = mp.MultiPhiModel(structure, [stop("m39", 5e-3, 2e4)], modes=37)
        x, v = 1e-3 * np.arange(40.0), 0.03 * (-1.0) ** np.arange(40)  # that shape is in no mode of the 37
        run = mp.simulate(model, 0.5, displacement=x, velocity=v, loads=loads)
        (told,) = run.warnings
        lost = run.ledger.truncation_kinetic + run.ledger.truncation_strain
        share = 100 * lost / np.max(run.energy(np.linspace(0, 0.5, 1001)))
        assert told.startswith("lost energy: truncation took ")
        assert float(told.split("took ")[1].split(" %")[0]) == pytest.approx(share, rel=0.1)

    def test_a_start_that_the_modes_do_not_hold_is_said(self):
        run = mp.simulate(mp.MultiPhiModel(chain(40), modes=2), 1.0, displacement=np.eye(40)[20])
        assert kinds(run) == ["truncation"]

    @pytest.mark.parametrize("stiffness", [1e4, math.inf])
    def test_nothing_is_said_where_no_mode_is_left_out(self, stiffness):
        model = mp.MultiPhiModel(chain(4), [stop("m1", 0.1, stiffness)], modes="all")
        run = mp.simulate(model, 40.0, displacement=np.array([0.5, 1.0, 0.3, 0.2]))
        assert len(run.events) > 5
        assert run.warnings == ()


class TestSlowModel:
    def test_mass_and_stiffness_in_the_wrong_order_are_said(self):
        n = 18
        stiffness = 4e4 * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
        right, swapped = mp.LinearStructure(np.eye(n), stiffness), mp.LinearStructure(stiffness, np.eye(n))
        assert mp.simulate(mp.MultiPhiModel(right), 1.0, velocity=np.ones(n)).warnings == ()
        (told,) = mp.simulate(mp.MultiPhiModel(swapped), 1.0, velocity=np.ones(n)).warnings
        assert told.startswith("slow model: its fastest mode takes 208 s for an oscillation, and the run lasts 1 s")


class TestDamping:
    def test_modes_for_which_a_list_has_no_ratio_are_named(self):
        model = mp.MultiPhiModel(chain(12, damping=mp.ModalDamping([0.01, 0.005])), modes=12)
        (told,) = mp.simulate(model, 1.0, velocity=np.ones(12)).warnings
        assert told.startswith(
            "undamped modes: ModalDamping lists 2 ratios and 12 modes are kept, so modes 3 to 12 are"
        )

    @pytest.mark.parametrize("ratios", [2.0, [0.5], [0.01, 1.0]])
    def test_ratios_that_look_like_per_cent_are_named(self, ratios):
        model = mp.MultiPhiModel(chain(2, damping=mp.ModalDamping(ratios)), modes=2)
        assert "damping ratios" in kinds(mp.simulate(model, 1.0, velocity=np.ones(2)))


class TestIssued:
    def test_each_is_issued_once_at_the_line_of_the_user(self):
        with pytest.warns(mp.MultiPhiWarning) as issued:
            run = released(long_chain(8))
        assert [str(one.message) for one in issued] == list(run.warnings)
        assert {one.filename for one in issued} == {__file__}


class TestSteadyState:
    def load(self):
        return mp.HarmonicLoad("m17", 20.0, 8.0)

    def test_a_frequency_response_issues_one_of_each_kind(self):
        model = mp.MultiPhiModel(
            chain(18, mass=0.5, stiffness=2e4, damping=mp.RayleighDamping(beta=1e-3)), [stop("m17", 1e-3, 1e6)], modes=8
        )
        with pytest.warns(mp.MultiPhiWarning) as issued:
            found = mp.frequency_response(model, self.load(), [8.0, 8.1], periods=32)
        assert [str(one.message) for one in issued] == list(found.warnings)
        assert len(set(kinds(found))) == len(found.warnings)
        assert "2 of 2 runs" in next(s for s in found.warnings if s.startswith("truncated contact"))


class TestHorizon:
    @pytest.mark.parametrize("scale", [1.0, 2.0**-20, 2.0**30])
    @pytest.mark.parametrize("restitution", [0.0, 0.5])
    @pytest.mark.parametrize("height", [0.5, 0.2])
    def test_a_bar_that_falls_flat_is_determined_until_it_strikes(self, scale, restitution, height):
        """Its motion has no tilt, and a tilt of 1e-12 changes all that follows."""
        feet = {"y": 0, "phi": 1, "l": np.array([1.0, -0.5 * scale]), "r": np.array([1.0, 0.5 * scale])}
        bar = mp.LinearStructure(np.diag([1.0, 0.1 * scale**2]), np.zeros((2, 2)), None, feet)
        stops = [mp.UnilateralContact(foot, foot, 0.0, restitution=restitution) for foot in ("l", "r")]
        loads = [mp.ConstantLoad("y", -9.81 * scale)]
        run = mp.simulate(mp.MultiPhiModel(bar, stops), 1.0, displacement=[height * scale, 0.0], loads=loads)
        struck = math.sqrt(2 * height / 9.81)
        if restitution:  # without one they stay on the ground both ways
            assert struck <= run.horizon() < struck + 0.1
        tilted = mp.simulate(mp.MultiPhiModel(bar, stops), 0.6, displacement=[height * scale, 1e-3], loads=loads)
        assert tilted.horizon() == 0.6

    @pytest.mark.parametrize("scale", [1.0, 2.0**-20])
    def test_a_mass_at_rest_on_a_hill_is_not_determined(self, scale):
        q = scale * np.array([-1, -0.2, 0, 0.2, 1.0])
        for slope in (-20.0, -5.0):
            law = mp.ForceLaw("m", (q, -slope * scale * np.array([-0.4, 0.2, 0.0, -0.2, 0.4])))
            hill = mp.MultiPhiModel(mp.LinearStructure([[1.0]], [[0.0]], None, {"m": 0}), [law])
            run, rate = mp.simulate(hill, 40.0), math.sqrt(-slope)
            assert np.all(run.at("m", np.linspace(0, 40.0, 101)) == 0.0)
            assert 20 / rate < run.horizon() < 32 / rate

    def test_sensitive_motion_parts_the_later_the_larger_the_tolerance(self):
        walls = [stop("m0", 0.05, 1e4, name="below"), mp.UnilateralContact("above", {"m2": -1.0}, 0.05, 1e4)]
        run = mp.simulate(mp.MultiPhiModel(chain(3), walls, modes="all"), 400.0, velocity=np.array([1.0, -0.3, 0.7]))
        early, late = run.horizon(1e-6), run.horizon(1e-1)
        assert 0 < early < late <= 400.0
        assert early < 400.0

    @pytest.mark.parametrize("tolerance", [0.0, 1.0, math.nan, "small"])
    def test_a_tolerance_is_a_number_between_0_and_1(self, tolerance):
        with pytest.raises(mp.MultiPhiValueError, match="tolerance: got"):
            mp.simulate(mp.MultiPhiModel(chain(1)), 1.0).horizon(tolerance)


@pytest.mark.parametrize("kind", ["compliant", "rigid", "mixed"])
def test_what_the_loop_adds_up_of_defects_is_the_sum_of_them(kind):
    known = 0
    for seed in range(30):
        model, random = random_model(seed, kind=kind)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            run = mp.simulate(model, 10.0, velocity=random.normal(size=model.structure.n))
        sums, rows = run.segments.truncation, event_table(run.events, model.index)
        assert_allclose(sums.truncated_energy, np.sum(np.abs(rows[:, 3])), rtol=1e-12, atol=1e-300)
        if not (model.whole or math.isnan(sums.defects)):
            exact = sum(defect.size**2 for defect in defects(run))
            assert_allclose(sums.defects, exact, rtol=1e-6, atol=1e-24)
            known += len(run.events) > 1
    assert known > 5


class TestFriction:
    def pads(self, static, velocity=0.0):
        """Two on one point, under a load that ends below what they bear."""
        structure = mp.LinearStructure([[1.0]], [[4.0]], points={"m": 0})
        pads = [mp.Friction("a", "m", 1.0, static), mp.Friction("b", "m", 1.0, static, velocity=velocity)]
        model = mp.MultiPhiModel(structure, pads, modes="all")
        return mp.simulate(model, 1.0, loads=[mp.SampledLoad("m", [0.0, 1.0], [0.0, 1.0])])

    def test_that_is_redundant_is_told_where_static_limits_make_it_ambiguous(self):
        with pytest.warns(mp.MultiPhiWarning, match="redundant friction: 'b' follows from 'a'.*67 % of"):
            self.pads(1.5)

    @pytest.mark.parametrize(("static", "told"), [((1.5, 2.0), ["redundant friction"]), ((1.0, 2.0), [])])
    def test_that_is_redundant_is_told_where_it_only_slips(self, static, told):
        """A drive that 1.5 + 2 would hold and 1 + 2 does not turns them: no instant at which one sticks for both."""
        pads = [mp.Friction(name, "m", 1.0, limit) for name, limit in zip("ab", static, strict=True)]
        structure = mp.LinearStructure([[1.0]], [[0.0]], points={"m": 0})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mp.MultiPhiWarning)
            model = mp.MultiPhiModel(structure, pads, modes="all")
            run = mp.simulate(model, 2.0, velocity=[1.0], loads=[mp.ConstantLoad("m", -3.2)])
        assert run.velocity(2.0) == pytest.approx([-(2.0 - 1 / 5.2) * 1.2], rel=1e-12)
        assert kinds(run) == told

    @pytest.mark.parametrize(("feet", "told"), [((0.3, 0.3), ["redundant friction"]), ((0.3,), [])])
    def test_of_elastic_contacts_that_hold_one_motion_is_told_where_one_has_a_static_limit(self, feet, told):
        """Their limits change with their pressures: which of them bears the load hangs on the way there."""
        structure = mp.LinearStructure(np.eye(2), np.zeros((2, 2)), points={"x": 0, "y": 1})
        stops = [
            mp.UnilateralContact(f"foot{k}", "y", 0.0, 1e3, friction=mu, tangential="x", static_friction=0.5 - 0.2 * k)
            for k, mu in enumerate(feet)
        ]
        weight = [mp.ConstantLoad("y", -9.81), mp.ConstantLoad("x", 1.0)]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mp.MultiPhiWarning)
            run = mp.simulate(mp.MultiPhiModel(structure, stops, modes="all"), 0.2, loads=weight)
        assert run.status == "ok"
        assert kinds(run) == told

    @pytest.mark.parametrize(
        ("loads", "coupling", "told"),
        [((4.5, 3.8), -0.3, ["friction in turn"]), ((3.5, 3.5), -0.3, []), ((4.5, 3.8), 0.0, [])],
    )
    def test_at_rigid_contacts_that_turns_at_one_instant_is_told(self, loads, coupling, told):
        """Two blocks on the floor, coupled by their mass; at 3.5 N both stick, which no order changes."""
        mass, kinetic = np.eye(4), 0.3 * 9.81
        mass[0, 2] = mass[2, 0] = coupling
        structure = mp.LinearStructure(mass, np.zeros((4, 4)), points={"x": 0, "y": 1, "u": 2, "v": 3})
        blocks = [
            mp.UnilateralContact(name, up, 0.0, friction=0.3, tangential=along, static_friction=0.4)
            for name, along, up in (("a", "x", "y"), ("b", "u", "v"))
        ]
        slowed = np.linalg.solve(mass[::2, ::2], np.array(loads) + kinetic)  # both stop after 1 s
        weight = [mp.ConstantLoad(up, -9.81) for up in "yv"]
        pulls = [mp.ConstantLoad(along, -load) for along, load in zip("xu", loads, strict=True)]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mp.MultiPhiWarning)
            model = mp.MultiPhiModel(structure, blocks, modes="all")
            run = mp.simulate(model, 2.0, velocity=[slowed[0], 0.0, slowed[1], 0.0], loads=weight + pulls)
        assert kinds(run) == told

    def test_of_constant_limits_or_on_another_belt_is_determined(self):
        assert self.pads(None).warnings == self.pads(1.5, 2.0).warnings == ()

    @pytest.mark.parametrize(("modes", "told"), [(7, ["backward slip"]), (9, []), ("all", [])])
    def test_that_truncation_turns_round_is_told(self, modes, told):
        """7 of 12 modes: a quarter of the time that it slips."""
        along = {"m9": 1.0, "m7": -0.5}
        rough = mp.UnilateralContact(
            "c", {"m8": -1.0}, 0.0, 400.0, friction=0.4, tangential=along, tangential_stiffness=1e3
        )
        model = mp.MultiPhiModel(chain(12, stiffness=40.0), [rough], modes=modes)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mp.MultiPhiWarning)
            run = mp.simulate(model, 6.0, loads=[mp.HarmonicLoad("m2", 6.0, 0.7)])
        assert [kind for kind in kinds(run) if kind == "backward slip"] == told
        assert all("'c' moves against its slip for 26 %" in text for text in run.warnings if "backward" in text)


@pytest.mark.parametrize(("stiffness", "told"), [(0.0, ""), (1e-32, " 100 % of"), (1e-14, " 2.5 % of"), (1e-2, "")])
def test_a_mode_too_slow_for_a_run_is_told_with_what_is_lost(stiffness, told):
    """m x'' + k x = p from rest: as good as p t^2 / 2 m, unless round-off takes it."""
    structure = mp.LinearStructure([[1.0]], [[stiffness]], points={"m": 0})
    model = mp.MultiPhiModel(structure, [stop("m", 1e3, 1e3)], modes="all")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mp.MultiPhiWarning)
        run = mp.simulate(model, 2.0, loads=[mp.ConstantLoad("m", 3.0)])
    assert kinds(run) == (["slow model", "slow mode"] if told else [])  # the only mode that there is
    assert told in "".join(run.warnings)
    if not told:
        omega = math.sqrt(stiffness)
        expected = 6.0 if omega == 0 else 3.0 * (1 - math.cos(2 * omega)) / stiffness
        assert run.at("m", 2.0) == pytest.approx(expected, rel=1e-9)


class TestOpenLedger:
    """Energy that is not accounted for, as of dampers that take other than the modes feel: nothing else would tell."""

    UNITS = ((1.0, 1.0), (2.0**-20, 2.0**30))  # of length and of mass

    def run(self, length=1.0, mass=1.0, loads=()):
        structure = chain(4, mass=mass, stiffness=40.0 * mass, damping=mp.ModalDamping(0.01))
        model = mp.MultiPhiModel(structure, [stop("m3", 0.05 * length, 400.0 * mass)], modes="all")
        x = 0.1 * length * np.arange(4.0)
        loads = [mp.ConstantLoad("m1", force * length * mass) for force in loads]
        return mp.simulate(model, 3.0, displacement=x, loads=loads)

    @pytest.mark.filterwarnings("ignore::multiphi_exudyn.MultiPhiWarning")
    @pytest.mark.parametrize("loads", [(), (-1.5,)], ids=["free", "loaded"])
    @pytest.mark.parametrize("units", UNITS)
    def test_is_told_with_its_share(self, units, loads, monkeypatch):
        run = self.run(*units, loads)
        assert run.warnings == ()
        given = replace(run.ledger, damping=1.01 * run.ledger.damping)
        run = replace(run, ending=replace(run.ending, ledger=mock.Mock(is_balanced=False)))
        monkeypatch.setattr(mp.Trajectory, "ledger", given)
        share = abs(given.residual) / given.turned_over
        assert 1e-4 < share < 1e-2
        (told,) = warnings_of(run)
        assert told.startswith("open ledger: ")
        assert float(told.split(": ")[1].split(" %")[0]) == pytest.approx(100 * share, rel=0.1)

    @pytest.mark.parametrize("row", ["friction", "damping", "impact"])
    def test_of_a_row_that_gives_what_it_can_only_take(self, row, monkeypatch):
        run = self.run()
        closed, gift = run.ledger, 1e-2 * run.ledger.initial
        run = replace(run, ending=replace(run.ending, ledger=mock.Mock(is_balanced=False)))
        given = replace(closed, **{row: -gift, "final": closed.final + gift + getattr(closed, row)})
        monkeypatch.setattr(mp.Trajectory, "ledger", given)
        assert abs(given.residual) < 1e-12 * closed.initial
        (told,) = warnings_of(run)
        assert told.startswith(f"open ledger: {row} gave 0.")
        monkeypatch.setattr(mp.Trajectory, "ledger", replace(given, **{row: -1e-14 * gift, "final": closed.final}))
        assert ("open ledger" in "".join(warnings_of(run))) == (getattr(closed, row) > 0)


class TestMeshImpacts:
    """A clamped bar of unit length, mass and stiffness before a rigid stop, pulled and let go: energy is not lost."""

    PERIOD = 10 / 3

    @staticmethod
    def bar(elements, tip=0.0):
        h, n = 1 / elements, elements + 1
        near = np.eye(n, k=1) + np.eye(n, k=-1)
        ends = np.diag([1.0, *[2.0] * (n - 2), 1.0])
        mass, stiffness = h / 6 * (2 * ends + near), (ends - near) / h
        mass[-1, -1] += tip
        return mp.LinearStructure(mass[1:, 1:], stiffness[1:, 1:], None, {"tip": elements - 1})

    @staticmethod
    def exact(x, t):
        """d'Alembert's: contact from 4/3 to 2, period 10/3."""
        corners = np.cumsum([0.0, -1.0, 1.0, 1.0, -1.0, -1.0])

        def travelled(s):
            whole, rest = np.divmod(np.asarray(s) + 1.0, 10 / 3)
            return whole * corners[-1] + np.interp(rest, 2 / 3 * np.arange(6), corners)

        return travelled(2.0 + t + x) - travelled(2.0 + t - x)

    def run(self, structure, periods, modes="all", start=None, **given):
        x = np.arange(1, structure.n + 1) / structure.n
        model = mp.MultiPhiModel(structure, [mp.UnilateralContact("wall", {"tip": -1.0}, 1.0, **given)], modes=modes)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mp.MultiPhiWarning)
            run = mp.simulate(model, periods * self.PERIOD, displacement=self.exact(x, 0.0) if start is None else start)
            many = mp.simulate_many(model, run.t_end, [run.model.base.modes.shapes @ run.start.displacement], threads=1)
        assert many.warnings[0] == run.warnings
        t = np.linspace(run.t_end - self.PERIOD, run.t_end, 20)
        apart = run.displacement(t) - np.array([self.exact(x, time) for time in t]).T
        return run, math.sqrt(np.max(np.mean(apart**2, axis=0)) / np.mean(self.exact(x, 0.0) ** 2))

    @pytest.mark.parametrize(
        ("elements", "modes", "periods"), [(20, "all", 3), (60, 12, 3), (60, "all", 10), (20, 6, 1)]
    )
    def test_that_took_what_the_mesh_decides_are_told(self, elements, modes, periods):
        run, error = self.run(self.bar(elements), periods, modes)
        (told,) = (sentence for sentence in run.warnings if sentence.startswith("mesh impacts: "))
        assert f"{100 * run.ledger.impact / run.ledger.initial:.2g} % of the largest energy" in told
        assert error > 0.05
