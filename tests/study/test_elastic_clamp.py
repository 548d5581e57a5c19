"""The rig on an elastic clamp: its frequencies are exact, tend to the rigid ones as 1/k, and are every model's own."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_scene import write

import multiphi_exudyn as mp
from multiphi_exudyn.mechanics.beam import Clamp, planar_beam
from multiphi_exudyn.study.measures import nrmse
from multiphi_exudyn.study.runners import run_model
from multiphi_exudyn.study.scene import load_scene, mechanics_of
from multiphi_exudyn.study.setup import prepare
from reference_models.exact_beam import exact_frequencies
from reference_models.full_beam import FullBeam, FullBeamSettings
from reference_models.rig import assumptions, rig_beam, rig_contact

ELASTIC = [Clamp(rotation=30.0), Clamp(rotation=300.0), Clamp(translation=1e4), Clamp(2e4, 100.0)]


def frequencies(structure, count=4):
    """Of the open level [Hz]."""
    return mp.MultiPhiModel(structure, modes=count).level(()).frequencies


def of_rig(clamp, count=4):
    return frequencies(planar_beam(rig_beam(clamp=clamp)), count)


class TestFrequencies:
    @pytest.mark.parametrize("clamp", ELASTIC)
    def test_are_those_of_the_transcendental_equation(self, clamp):
        assert_allclose(of_rig(clamp), exact_frequencies(rig_beam(clamp=clamp), 4), rtol=3e-6)

    @pytest.mark.parametrize("clamp", ELASTIC)
    def test_with_the_support_closed_are_those_of_the_pinned_beam(self, clamp):
        model = mp.MultiPhiModel(planar_beam(rig_beam(clamp=clamp)), [rig_contact()], modes=4)
        pin = rig_beam().points["node2"]
        assert_allclose(
            model.level(("support",)).frequencies, exact_frequencies(rig_beam(clamp=clamp), 4, [pin]), rtol=3e-6
        )

    @pytest.mark.parametrize(
        "clamps",
        [[Clamp(rotation=k) for k in (1e4, 1e5, 1e6)], [Clamp(translation=k) for k in (1e7, 1e8, 1e9)]],
        ids=["rotation", "translation"],
    )
    def test_come_to_the_rigid_clamps_from_below_as_one_over_the_stiffness(self, clamps):
        rigid = of_rig(Clamp())
        missing = np.array([rigid - of_rig(clamp) for clamp in clamps])
        assert np.all(missing > 0)
        assert np.all(missing[-1] < 5e-4 * rigid)
        assert_allclose(np.log10(missing[:-1] / missing[1:]), 1.0, atol=0.03)

    def test_of_the_first_mode_follow_the_clamps_own_flexibility(self):
        """A rigid beam on a rotation spring: k = omega^2 I about the clamp; there the beam's bending is nothing."""
        softest = 1e-2
        beam = rig_beam(clamp=Clamp(rotation=softest))
        section, mass = beam.sections[0], beam.masses[0]
        length = section.end - section.start
        per_length = section.density * section.area
        inertia = per_length * length**3 / 3 + per_length / section.area * section.second_moment * length
        inertia += mass.mass * mass.at**2 + mass.inertia
        assert of_rig(beam.clamp, 1)[0] == pytest.approx(np.sqrt(softest / inertia) / (2 * np.pi), rel=1e-3)


class TestFullBeam:
    @pytest.mark.parametrize(
        ("clamp", "kind", "elements", "ceiling"),
        [*((clamp, "ancf", 20, 7e-4) for clamp in ELASTIC), (ELASTIC[-1], "geometrically-exact", 114, 8e-4)],
    )
    def test_linearised_has_the_planar_beams_frequencies(self, clamp, kind, elements, ceiling):
        full = FullBeam(rig_beam(clamp=clamp), (), FullBeamSettings(kind=kind, elements=elements))
        assert_allclose(frequencies(full.structure), of_rig(clamp), rtol=ceiling)

    @pytest.mark.parametrize("kind", ["ancf", "geometrically-exact"])
    def test_linearised_at_the_clamp_has_the_springs_themselves(self, kind):
        """Between two clamps the stiffness matrices differ by the springs' difference alone."""
        soft, stiff = (
            FullBeam(rig_beam(clamp=c), (), FullBeamSettings(kind=kind, elements=6)).structure.stiffness
            for c in (Clamp(1e4, 50.0), Clamp(3e4, 80.0))
        )
        added = np.linalg.eigvalsh(stiff - soft)
        assert_allclose(added[-2:], [30.0, 2e4], rtol=1e-5)
        assert np.max(np.abs(added[:-2])) < 1e-3


SCENE = {
    "base": "paper-rig",
    "title": "the rig on an elastic clamp, little displaced",
    "structure": {
        "rig": "measured-free",
        "support_stiffness": 1e5,
        "clamp_translation": 5e4,
        "clamp_rotation": 100.0,
    },
    "start": {"load_at": "hole3", "measured_at": "node3", "displacement": 4e-3},
    "outputs": {"t_end": 0.12, "judged_points": ["node2", "node3"]},
    "models": [
        {"kind": "full", "name": "full", "elements": 8, "step": 4e-5},
        {"kind": "reduced", "name": "all", "modes": "all"},
        {"kind": "user-object", "name": "body", "modes": 12, "step": 1e-4},
    ],
    "comparison": {"reference": "full"},
}
ONE_STEP = 1e-4  # of the full model's time step at this displacement, which leaves 3e-5


def bench_of(folder, **structure):
    scene = load_scene(write(folder / "scene.toml", SCENE | {"structure": SCENE["structure"] | structure}))
    return prepare(scene)


def test_all_models_of_a_scene_stand_on_its_clamp(tmp_path):
    setup = bench_of(tmp_path)
    full, everything, body = (run_model(setup, name, progress=False) for name in ("full", "all", "body"))
    rigid = run_model(bench_of(tmp_path, clamp_translation="rigid", clamp_rotation="rigid"), "all", progress=False)
    assert full.ok
    assert len(full.contact_intervals["support"])
    for point in setup.judged_points:
        assert nrmse(everything.points[point], full.points[point], full.time, 0.12) < ONE_STEP
        assert nrmse(body.points[point], everything.points[point], full.time, 0.12) < ONE_STEP
        assert nrmse(rigid.points[point], full.points[point], full.time, 0.12) > 1000 * ONE_STEP


def test_a_scenes_word_for_an_infinite_stiffness_is_rigid(tmp_path):
    mechanics = bench_of(tmp_path, clamp_translation="rigid").mechanics
    assert mechanics.beam.clamp == Clamp(rotation=100.0)


def test_the_clamp_is_listed_among_the_assumptions_with_its_numbers():
    given = [line for line in assumptions(clamp=Clamp(2e4, 100.0)) if line.startswith("clamp: ")]
    assert given[0].startswith("clamp: elastic, 20000 N/m in translation and 100 N m/rad in rotation (assumed: ")
    assert [line for line in assumptions() if line.startswith("clamp: ideally rigid (assumed: ")]


def test_printed_frequencies_are_of_a_rigid_clamp(tmp_path, refused):
    data = SCENE | {"structure": {"rig": "as-published", "support_stiffness": 1e6, "clamp_rotation": 1e3}}
    data["models"] = [{"kind": "reduced", "name": "r", "contact": "rigid"}]
    data["comparison"] = {"reference": "r"}
    file = write(tmp_path / "scene.toml", data)
    refused(ValueError, f"{file}: structure.clamp_rotation: got 1000.0", mechanics_of, load_scene(file))


@pytest.mark.parametrize("value", [0.0, -1.0, "soft", True])
def test_a_stiffness_is_positive_or_rigid(tmp_path, refused, value):
    data = SCENE | {"structure": SCENE["structure"] | {"clamp_rotation": value}}
    file = write(tmp_path / "scene.toml", data)
    refused(ValueError, f"{file}: structure.clamp_rotation: got {value!r}", load_scene, file)
