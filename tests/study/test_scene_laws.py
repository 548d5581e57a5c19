"""Force laws and viscous contacts in scene files: what they become, wrong ones, models that agree, the report."""

import numpy as np
import pytest
from small_scene import BEAM, changed, write

from multiphi_exudyn import MultiPhiValueError
from multiphi_exudyn.study.compare import compare, summary
from multiphi_exudyn.study.details import details_of, level_modes
from multiphi_exudyn.study.measures import nrmse
from multiphi_exudyn.study.report import findings, render
from multiphi_exudyn.study.scene import load_scene, mechanics_of
from multiphi_exudyn.study.setup import prepare, start_configuration
from multiphi_exudyn.study.wording import percent

pytestmark = pytest.mark.usefixtures("few_elements")

SPAN = {"span": [-0.015, 0.015], "tolerance": 0.003}
CUBIC = {"kind": "cubic", "name": "spring", "at": "tip", "k1": 50.0, "k3": 2e6} | SPAN
LAWS = {
    "table": {"kind": "table", "name": "spring", "at": "tip", "q": [-0.01, -2e-3, 4e-3], "force": [-3.0, 0.0, 0.3]},
    "cubic": CUBIC,
    "hertz": {"kind": "hertz", "name": "ball", "at": "tip", "stiffness": 2e4, "gap": 1e-3} | SPAN,
    "magnet": {"kind": "magnet", "name": "pole", "at": "tip", "strength": 1e-4, "distance": -0.025} | SPAN,
}
EXACT = {
    "table": lambda q: np.interp(q, [-0.01, -2e-3, 4e-3], [-3.0, 0.0, 0.3]),
    "cubic": lambda q: 50.0 * q + 2e6 * q**3,
    "hertz": lambda q: -2e4 * np.maximum(-q - 1e-3, 0.0) ** 1.5,
    "magnet": lambda q: 1e-4 / (q + 0.025) ** 2,  # pulls down
}
MODELS = [
    {"kind": "reduced", "name": "r12", "modes": 12},
    {"kind": "user-object", "name": "body", "modes": 6, "step": 2e-4},
    {"kind": "global-basis", "name": "basis", "modes": 8},
    {"kind": "full", "name": "full", "elements": 4, "step": 1e-4},
]
STIFFNESS = 7e10 * 0.02 * 0.004**3 / 12  # of the beam against bending, N m^2
VISCOUS = BEAM["contacts"][0] | {"damping": 300.0}


def with_laws(*laws, **fields):
    """The small scene without its stop, held by laws."""
    data = BEAM | {"contacts": [], "force_laws": list(laws), "models": MODELS[:1]}
    return data | {"comparison": {"reference": "r12"}, "damping": {"modal_ratios": [0.02], "beyond": 0.05}} | fields


def viscous(**fields):
    return with_laws(**({"contacts": [VISCOUS]} | fields))


def bench_of(folder, data):
    scene = load_scene(write(folder / "scene.toml", data))
    return prepare(scene)


def compared(folder, data):
    return compare(bench_of(folder, data), {}, progress=False)


def differences(comparison):
    """NRMSE of the tip to the reduced model of every other run; all must have run."""
    runs = comparison.runs
    assert {name: run.message for name, run in runs.items()} == dict.fromkeys(runs, "")
    own = runs["r12"]
    return {name: nrmse(run.points["tip"], own.points["tip"], own.time, 0.1) for name, run in runs.items()}


class TestForms:
    @pytest.mark.parametrize("kind", LAWS)
    def test_every_kind_becomes_its_law(self, tmp_path, kind):
        (law,) = bench_of(tmp_path, with_laws(LAWS[kind])).mechanics.force_laws
        q = np.linspace(*law.knots[[0, -1]], 500)
        largest = np.max(np.abs(EXACT[kind](q)))
        np.testing.assert_allclose(law.force(q), EXACT[kind](q), atol=0.0031 * largest)
        assert (law.name, law.at) == (LAWS[kind]["name"], "tip")

    @pytest.mark.parametrize(("distance", "pull"), [(0.02, 1.0), (-0.02, -1.0)])
    def test_a_magnet_attracts_from_its_side_and_repels_with_a_negative_strength(self, tmp_path, distance, pull):
        attracts = LAWS["magnet"] | {"distance": distance}
        repels = attracts | {"name": "other", "strength": -1e-4}
        first, second = bench_of(tmp_path, with_laws(attracts, repels)).mechanics.force_laws
        assert -first.law(0.0) == pytest.approx(pull * 1e-4 / 0.02**2)
        assert second.law(0.0) == -first.law(0.0)

    def test_segments_instead_of_a_tolerance(self, tmp_path):
        counted = {key: value for key, value in CUBIC.items() if key != "tolerance"} | {"segments": 8}
        (law,) = bench_of(tmp_path, with_laws(counted)).mechanics.force_laws
        assert len(law.slopes) == 8

    def test_a_law_is_in_balance_at_the_start(self, tmp_path):
        """At the tip a static force holds beam and law together, everywhere else the beam is in balance."""
        setup = bench_of(tmp_path, with_laws(CUBIC))
        model = setup.model(setup.scene.models["r12"])
        x, tip = start_configuration(setup, model), setup.structure.row("tip")
        assert tip @ x == pytest.approx(0.01, rel=1e-9)
        assert setup.structure.stiffness @ x == pytest.approx(tip * 3 * 0.01 * STIFFNESS / 0.5**3, rel=2e-3, abs=1e-6)
        held = tip @ setup.structure.stiffness @ x + setup.mechanics.force_laws[0].force(0.01)
        np.testing.assert_allclose(model.static_equilibrium({"tip": held}), x, atol=1e-9 * 0.01)


RIG = {"rig": "as-published", "support_stiffness": "rigid"}
RIGID = {"kind": "reduced", "name": "r12", "modes": 6, "contact": "rigid"}
COMPONENT = {"kind": "craig-bampton", "name": "cb", "modes": 2, "step": 1e-4}
STEPWISE = {"kind": "solve-ivp", "name": "ivp", "method": "RK45", "rtol": 1e-4}
RIG_START = {"load_at": "hole3", "force": -1.0}
BROKEN = {
    "unknown kind": ([CUBIC | {"kind": "quintic"}], {}, "force_laws[0]: got"),
    "unknown point": ([CUBIC | {"at": "tap"}], {}, "force_laws[0].at: got 'tap', need one of the points"),
    "unknown field": ([CUBIC | {"k5": 1.0}], {}, "force_laws[0].k5: got 1.0, need a known field"),
    "no coefficient": ([{k: v for k, v in CUBIC.items() if k != "k3"}], {}, "force_laws[0].k3: got nothing, need"),
    "span of a table": ([LAWS["table"] | SPAN], {}, "force_laws[0].span: got"),
    "a span that goes back": ([CUBIC | {"span": [0.01, -0.01]}], {}, "force_laws[0]: force law 'spring' span: got"),
    "two accuracies": ([CUBIC | {"segments": 9}], {}, "force_laws[0]: force law 'spring': got tolerance 0.003 and seg"),
    "a table that goes back": (
        [LAWS["table"] | {"q": [0.0, -1.0, 1.0]}], {}, "force_laws[0]: force law 'spring' law: got a table"
    ),
    "a magnet in the span": ([LAWS["magnet"] | {"distance": 0.01}], {}, "force_laws[0]: got"),
    "a name twice": ([CUBIC, CUBIC], {}, "force_laws[1].name: got 'spring', need another name"),
    "the name of a contact": (
        [CUBIC | {"name": "stop"}], {"contacts": BEAM["contacts"]}, "force_laws[0].name: got 'stop', need another name"
    ),
    "on a component": ([CUBIC], {"models": [COMPONENT]}, "models[0].kind: got 'craig-bampton', need another kind"),
    "of a stepwise model": ([CUBIC], {"models": [STEPWISE]}, "models[0].kind: got 'solve-ivp', need another kind"),
    "two points of a full beam": (
        [CUBIC | {"at": {"tip": 1.0, "middle": -1.0}}], {"models": MODELS[3:]}, "models[0].kind: got 'full', need"
    ),
    "beside printed frequencies": (
        [CUBIC | {"at": "node3"}], {"structure": RIG, "models": [RIGID], "start": RIG_START, "outputs": {"t_end": 0.1}},
        "force_laws[0].name: got 'spring', need no force_laws",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_a_wrong_law_is_named_with_what_was_given_and_needed(tmp_path, case):
    laws, fields, expected = BROKEN[case]
    data = with_laws(*laws, **fields)
    data["comparison"] = {"reference": data["models"][0]["name"]}
    file = write(tmp_path / "scene.toml", data)
    with pytest.raises(MultiPhiValueError) as caught:
        mechanics_of(load_scene(file))
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith(f"{file}: {expected}")


class TestModels:
    @pytest.mark.parametrize("kind", LAWS)
    def test_reduced_user_object_global_basis_and_full_model_move_as_one(self, tmp_path, kind):
        comparison = compared(tmp_path, with_laws(LAWS[kind], models=MODELS))
        found = differences(comparison)
        assert found["body"] < 1e-3
        assert found["basis"] < 1e-3
        assert found["full"] < 0.02
        assert all(run.contact_intervals == run.gaps == {} for run in comparison.runs.values())

    def test_without_its_law_the_beam_moves_otherwise(self, tmp_path):
        held = compared(tmp_path, with_laws(CUBIC)).runs["r12"]
        free = compared(tmp_path, with_laws()).runs["r12"]
        assert nrmse(free.points["tip"], held.points["tip"], held.time, 0.1) > 0.3

    def test_a_viscous_stop_takes_as_much_in_every_model(self, tmp_path):
        comparison = compared(tmp_path, viscous(models=MODELS))
        found = differences(comparison)
        assert found["body"] < 1e-3
        assert found["full"] < 0.02
        dry = compared(tmp_path, viscous(contacts=BEAM["contacts"])).runs["r12"]
        wet, full = comparison.runs["r12"], comparison.runs["full"]
        assert wet.energy[-1] < 0.95 * dry.energy[-1]
        assert full.energy[-1] == pytest.approx(wet.energy[-1], rel=0.03)


class TestReport:
    def test_laws_are_told_with_their_error_and_with_a_span_that_is_left(self, tmp_path):
        short = CUBIC | {"span": [-0.005, 0.005]}
        comparison = compared(tmp_path, with_laws(short, models=[MODELS[0], MODELS[0] | {"name": "r6", "modes": 6}]))
        told = findings(comparison)
        assert "the force law cubic (name spring, at tip, " in told["compared"][0]
        (followed,) = (line for line in told["distrust"] if "force law spring" in line)
        law = comparison.setup.mechanics.force_laws[0]
        assert f"by {len(law.slopes)} straight segments from -5 to 5 mm, to {percent(law.error)} of" in followed
        assert "leaves the span of the force law spring (-5 to 5 mm): it reaches" in followed
        assert comparison.runs["r6"].label == "Multi-Phi, levels of force laws, r = 6"
        page = render(comparison, details_of(comparison))
        assert "Without the force laws" in page
        assert summary(comparison)["scene"]["force_laws"][0]["k3"] == 2e6

    def test_a_span_that_is_not_left_is_not_told(self, tmp_path):
        told = findings(compared(tmp_path, with_laws(CUBIC)))["distrust"]
        assert not any("leaves the span" in line for line in told)

    def test_viscous_contacts_are_drawn_as_rigid_ones_where_levels_are_rigid(self, tmp_path):
        rigid = {"kind": "reduced", "name": "rigid", "modes": 6, "contact": "rigid"}
        comparison = compared(tmp_path, viscous(models=[MODELS[0], rigid]))
        assert comparison.runs["rigid"].message == ""
        assert [level.name for level in level_modes(comparison)] == ["open", "stop closed"]
        assert "100 kN/m, 300 N s/m" in findings(comparison)["compared"][0]
        assert summary(comparison)["scene"]["contacts"]["stop"]["damping"] == 300.0

    def test_laws_on_the_rig_are_assumptions(self, tmp_path):
        shaken = changed(
            ["structure"], {"rig": "measured-free", "support_stiffness": 1e6}, with_laws(CUBIC | {"at": "node3"})
        )
        shaken |= {"start": RIG_START, "outputs": {"t_end": 0.1}}
        scene = load_scene(write(tmp_path / "scene.toml", shaken))
        assert any(
            line.startswith("force law of this scene: cubic (name spring, at node3, ")
            for line in mechanics_of(scene).assumptions
        )
