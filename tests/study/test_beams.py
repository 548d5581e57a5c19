"""Several beams in one scene and in one full model: contacts between them, ties, and rows of points and contacts."""

import copy

import numpy as np
import pytest
from small_scene import BEAM, write

import multiphi_exudyn as mp
from multiphi_exudyn.mechanics.beam import Beam, Section, planar_beam
from multiphi_exudyn.study.runners import run_model
from multiphi_exudyn.study.scene import load_scene, mechanics_of
from multiphi_exudyn.study.setup import prepare
from reference_models.beams import Beams
from reference_models.full_beam import FullBeam, FullBeamSettings

NEW = ("two-sided-stop", "clapping-cantilevers", "beam-chain", "bed-of-stops")
CONTACTS = (2, 1, 3, 100)
T_END = 0.06  # s
SMALL = 1e-3  # m: small enough for linear geometry


def beam(length, height):
    section = Section.rectangle(0, length, width=0.03, height=height, youngs_modulus=7e10, density=2700)
    return Beam([section], {"tip": length, "middle": length / 2})


PAIR = {"a": beam(0.5, 0.004), "b": beam(0.4, 0.005)}
TIPS = mp.UnilateralContact("tips", {"a.tip": 2.0, "b.tip": -2.0}, 2e-4, 1e4)


def frequencies(structure, count=6):
    return mp.MultiPhiModel(structure, modes=count).level(()).frequencies


def scene_with(tmp_path, **fields):
    data = copy.deepcopy(BEAM) | fields
    return load_scene(write(tmp_path / "beams.toml", data))


class TestFullModel:
    @pytest.mark.parametrize("kind", ["ancf", "geometrically-exact"])
    def test_several_beams_have_the_matrices_of_each_alone(self, kind):
        settings = FullBeamSettings(kind=kind, elements=3)
        parts = {name: FullBeam(part, (), settings).structure for name, part in PAIR.items()}
        found, wanted = FullBeam(Beams(PAIR), (), settings).structure, mp.assemble(parts)
        assert sorted(found.points) == sorted(wanted.points)
        np.testing.assert_allclose(frequencies(found), frequencies(wanted), rtol=1e-9)
        for point in found.points:
            compliance = [s.row(point) @ np.linalg.solve(s.stiffness, s.row(point)) for s in (found, wanted)]
            assert compliance[0] == pytest.approx(compliance[1], rel=1e-9)

    def test_tied_beams_are_the_assembly_with_the_same_ties(self):
        ties = ({"a.tip": 1.0, "b.tip": 0.5}, {"b.middle": 1.0})
        settings = FullBeamSettings(elements=4)
        found = FullBeam(Beams(PAIR, ties), (), settings).structure
        wanted = mp.assemble({name: FullBeam(part, (), settings).structure for name, part in PAIR.items()}, ties)
        np.testing.assert_allclose(frequencies(found), frequencies(wanted), rtol=1e-8)
        held = np.linalg.solve(found.stiffness, found.row("a.tip"))
        assert found.row("a.tip") @ held == pytest.approx(-0.5 * found.row("b.tip") @ held, rel=1e-6)
        assert abs(found.row("b.middle") @ held) < 1e-9 * abs(found.row("a.tip") @ held)

    @pytest.mark.parametrize("damping", [0.0, 2.0])
    def test_beams_that_clap_are_all_modes_of_their_assembly(self, damping):
        contact = mp.UnilateralContact("tips", TIPS.direction, TIPS.gap, TIPS.stiffness, damping)
        full = FullBeam(Beams(PAIR), [contact], FullBeamSettings(elements=4, step=2e-5, newton_tolerance=1e-6))
        own = 1e-5 * full.structure.stiffness
        start = {"load_at": "a.tip", "measured_at": "a.tip", "displacement": SMALL}
        run = full.run(T_END, damping=own, progress=False, **start)
        assert run.status == "ok", run.message
        structure = mp.LinearStructure(full.structure.mass, full.structure.stiffness, own, full.structure.points)
        model = mp.MultiPhiModel(structure, [contact], modes="all")
        unit = model.static_equilibrium({"a.tip": 1e-6})
        trajectory = mp.simulate(model, T_END + 1e-9, displacement=unit * SMALL / float(structure.row("a.tip") @ unit))
        assert len(run.contact_intervals["tips"]) == len(trajectory.contact_intervals("tips")) >= 1
        for point in ("a.tip", "b.tip"):
            wanted = np.asarray(trajectory.at(point, run.time))
            assert np.linalg.norm(run.points[point] - wanted) < 2e-3 * np.linalg.norm(wanted)
        forces = np.asarray(trajectory.contact_force("tips", run.time))
        assert np.linalg.norm(run.contact_force["tips"] - forces) < 2e-2 * np.linalg.norm(forces)

    def test_a_beam_alone_needs_no_name(self):
        assert Beams({"": PAIR["a"]}).only is PAIR["a"]
        with pytest.raises(mp.MultiPhiValueError, match="none empty"):
            Beams({"": PAIR["a"], "b": PAIR["b"]})

    @pytest.mark.parametrize(
        ("tie", "match"),
        [
            ({"a.end": 1.0}, r"ties\[0\]: got 'a.end'"),
            ({"a.tip": 1.0, "b.tip": 0.0}, "not zero"),
            ({"a.tip": 1.0, "b.tip": 1.0, "a.middle": 1.0}, "one or two points"),
        ],
    )
    def test_ties_the_full_model_cannot_have(self, tie, match):
        with pytest.raises(mp.MultiPhiValueError, match=match):
            Beams(PAIR, (tie,))

    def test_a_round_support_meets_one_point_only(self):
        with pytest.raises(mp.MultiPhiValueError, match="need one point"):
            FullBeam(Beams(PAIR), [TIPS], FullBeamSettings(elements=2, contact="circle"))


class TestScenes:
    @pytest.mark.parametrize(("name", "contacts"), list(zip(NEW, CONTACTS, strict=True)))
    def test_a_shipped_scene_has_its_contacts_and_its_full_model(self, name, contacts):
        scene = load_scene(name)
        assert len(mechanics_of(scene).contacts) == contacts
        assert scene.models[scene.file.comparison.reference].kind == "full"

    @pytest.mark.parametrize(("name", "t_end"), [("two-sided-stop", 0.03), ("clapping-cantilevers", 0.03)])
    def test_reduced_and_full_agree_through_the_first_contacts(self, name, t_end):
        scene = load_scene(name, t_end=t_end)
        setup = prepare(scene)
        first = next(name for name, spec in scene.models.items() if spec.kind == "reduced")
        reduced, full = (run_model(setup, name, progress=False) for name in (first, "full-cheapest"))
        assert sum(len(given) for given in full.contact_intervals.values()) >= 1
        for point in setup.judged_points:
            difference = np.linalg.norm(reduced.points[point] - full.points[point])
            assert difference < 0.02 * np.linalg.norm(full.points[point])

    def test_beams_without_a_full_model_are_assembled(self, tmp_path):
        part = BEAM["structure"]["beam"]
        ties = [{"a.tip": 1.0, "b.tip": -1.0}]
        scene = scene_with(
            tmp_path,
            structure={"beams": {"a": part, "b": part}, "ties": ties},
            contacts=[{"name": "stop", "direction": "a.middle", "gap": 1e-3, "stiffness": 1e5}],
            start={"load_at": "a.tip", "measured_at": "b.tip", "displacement": 0.01},
            outputs={"t_end": 0.1, "points": ["a.tip"], "interval": 1e-3},
        )
        setup = prepare(scene)
        parts = {name: planar_beam(setup.mechanics.beams.parts[name], 57) for name in ("a", "b")}
        np.testing.assert_allclose(frequencies(setup.structure), frequencies(mp.assemble(parts, ties)), rtol=1e-9)

    def test_a_row_is_its_points_and_contacts_one_by_one(self, tmp_path):
        rows, single = copy.deepcopy(BEAM), copy.deepcopy(BEAM)
        rows["structure"]["beam"]["points"] = {"p{i}": {"first": 0.1, "last": 0.5, "count": 3}, "tip": 0.5}
        single["structure"]["beam"]["points"] = {"p1": 0.1, "p2": 0.3, "p3": 0.5, "tip": 0.5}
        stop = {"gap": 1e-3, "stiffness": 1e5}
        rows["contacts"] = [stop | {"name": "s{i}", "direction": {"p{i}": -1.0}, "count": 3}]
        single["contacts"] = [stop | {"name": f"s{i}", "direction": {f"p{i}": -1.0}} for i in (1, 2, 3)]
        first, second = (mechanics_of(scene_with(tmp_path, **data)) for data in (rows, single))
        assert [repr(contact) for contact in first.contacts] == [repr(contact) for contact in second.contacts]
        assert first.beam.points == pytest.approx(second.beam.points)

    @pytest.mark.parametrize(
        ("direction", "contact", "match"),
        [
            ({"a.tip": 1.0, "b.tip": -0.5}, "coordinate", "between two"),
            ({"a.tip": 1.0, "b.tip": -1.0}, "circle", "round support"),
            ({"a.tip": 1.0, "b.end": -1.0}, "coordinate", "b.end"),
        ],
    )
    def test_contacts_between_beams_that_the_full_model_cannot_have(self, tmp_path, direction, contact, match):
        part = BEAM["structure"]["beam"]
        model = {"kind": "full", "name": "full", "elements": 2, "step": 1e-4, "contact": contact}
        scene = scene_with(
            tmp_path,
            structure={"beams": {"a": part, "b": part}},
            contacts=[{"name": "tips", "direction": direction, "gap": 1e-3, "stiffness": 1e5}],
            start={"load_at": "a.tip", "measured_at": "a.tip", "displacement": 0.01},
            outputs={"t_end": 0.1},
            models=[model],
            comparison={"reference": "full"},
        )
        with pytest.raises(mp.MultiPhiValueError, match=match):
            mechanics_of(scene)

    def test_a_row_of_points_needs_a_place_for_its_number(self, tmp_path):
        data = copy.deepcopy(BEAM)
        data["structure"]["beam"]["points"] = {"p": {"first": 0.1, "last": 0.5, "count": 3}, "middle": 0.3, "tip": 0.5}
        with pytest.raises(mp.MultiPhiValueError, match=r"structure.beam: points: got the name 'p'"):
            mechanics_of(scene_with(tmp_path, **data))
