"""A study from its file to its rows: what is run, where, once, and against which reference."""

import json

import numpy as np
import pytest
from small_scene import BEAM, changed, write

from multiphi_exudyn import MultiPhiValueError
from multiphi_exudyn.study import runners
from multiphi_exudyn.study import runs as timing
from multiphi_exudyn.study.accuracy import points, run_study, settings, settings_at, stiff_errors, uncertainty
from multiphi_exudyn.study.runs import ModelRun
from multiphi_exudyn.study.setup import prepare
from multiphi_exudyn.study.store import Store
from multiphi_exudyn.study.study_file import CASE, load_study, shipped_studies
from multiphi_exudyn.study.sweep import open_executor

SHIPPED = (
    "amplitude",
    "clamp",
    "clamp-play",
    "clamp-translation",
    "initial-displacement",
    "modes",
    "modes-rigid",
    "pareto",
    "pareto-stiff",
    "sets",
    "support",
)
STUDY = {
    "title": "a small study",
    "scene": "small.toml",
    "window": 0.08,
    "axes": {"start.displacement": [0.01, 0.005]},
    "methods": [
        {"name": "levels", "model": {"kind": "reduced"}, "axes": {"modes": [2, 4, 8]}, "quick": {"modes": [3]}},
        {
            "name": "stepwise",
            "model": {"kind": "solve-ivp", "method": "DOP853", "modes": 2},
            "axes": {"rtol": [1e-5]},
            "nearby": {"rtol": [0.5]},
        },
    ],
    "quick": {"change": {"outputs.t_end": 0.05}, "axes": {"start.displacement": [0.01]}},
}
SCENE = BEAM | {
    "models": [{"kind": "reduced", "name": "all", "modes": "all"}, {"kind": "reduced", "name": "r12", "modes": 12}],
    "comparison": {"reference": "all", "coarser": "r12"},
}


def at_rest(setup, name, progress, horizon=False):
    """A run in which nothing moves."""
    points = {point: np.zeros(len(setup.time)) for point in setup.points}
    return ModelRun(name, setup.scene.models[name].kind, name, time=setup.time, points=points)


@pytest.fixture
def study_file(tmp_path):
    write(tmp_path / "small.toml", SCENE)
    return lambda data=STUDY: write(tmp_path / "study.toml", data)


@pytest.fixture
def store(tmp_path):
    with Store(tmp_path / "runs.sqlite") as opened:
        yield opened


class TestCases:
    def test_every_setting_with_its_neighbours_at_every_point(self, study_file):
        study = load_study(study_file())
        assert study.points == [{"start.displacement": 0.01}, {"start.displacement": 0.005}]
        cases = study.runs(study.points[0])
        assert [case["method"] for case in cases] == ["coarser"] + 3 * ["levels"] + 2 * ["stepwise"]
        assert [case["setting"] for case in cases[1:4]] == [{"modes": 2}, {"modes": 4}, {"modes": 8}]
        assert [case["nearby"] for case in cases[4:]] == [{}, {"rtol": 0.5}]
        assert {json.dumps(case) for case in cases} != {json.dumps(case) for case in study.runs(study.points[1])}

    def test_a_case_has_its_scene(self, study_file):
        study = load_study(study_file())
        case = study.runs(study.points[1])[-1]
        scene = study.scene_for(case)
        assert scene.file.start.displacement == 0.005
        assert list(scene.models) == ["all", "r12", CASE]
        assert scene.models[CASE].rtol == pytest.approx(0.5e-5)
        assert study.model_name(case) == CASE
        assert study.model_name(study.reference(study.points[0])) == "all"
        assert study.model_name(study.runs(study.points[0])[0]) == "r12"

    def test_a_reference_with_its_number_of_modes_in_its_name(self, tmp_path, study_file):
        models = [{"kind": "reduced", "name": "fine-{modes}", "modes": 12}, {"kind": "reduced", "name": "own-{modes}"}]
        for reference in ("fine-12", "own-6"):
            write(tmp_path / "small.toml", SCENE | {"models": models, "comparison": {"reference": reference}})
            study = load_study(study_file())
            assert list(study.scene_for(study.reference({})).models) == [reference]

    def test_the_short_form(self, study_file):
        study = load_study(study_file(), quick=True)
        assert study.points == [{"start.displacement": 0.01}]
        assert study.scene_for(study.reference(study.points[0])).file.outputs.t_end == 0.05
        assert [c["setting"] for c in study.runs(study.points[0]) if c["method"] == "levels"] == [{"modes": 3}]

    def test_what_could_alter_a_run_alters_its_parameters(self, study_file):
        first = load_study(study_file())
        for change in (
            STUDY | {"change": {"outputs.t_end": 0.09}},
            changed(["methods", 0, "model"], {"kind": "reduced", "contact": "rigid"}, STUDY),
        ):
            other = load_study(study_file(change))
            assert first.runs(first.points[0])[1] != other.runs(other.points[0])[1]

    def test_the_matrices_and_the_versions_that_made_a_run_belong_to_it(self, tmp_path, study_file, monkeypatch):
        scene = SCENE | {"structure": {"matrices": "beam.npz", "points": {"tip": 1}}, "contacts": [], "damping": None}
        scene |= {"start": {"load_at": "tip", "force": 1.0}}
        del scene["damping"]
        write(tmp_path / "small.toml", scene)
        found = []
        for stiffness in (3.0, 4.0):
            np.savez(tmp_path / "beam.npz", mass=np.eye(20), stiffness=stiffness * np.eye(20))
            study = load_study(study_file(STUDY | {"axes": {}, "quick": {}}))
            found.append(study.runs({})[1]["content"])
        monkeypatch.setattr("multiphi_exudyn.study.study_file._versions", lambda: {"exudyn": "another"})
        found.append(study.runs({})[1]["content"])
        assert len(set(found)) == 3

    def test_another_title_or_another_method_beside_it_alters_nothing(self, study_file):
        first = load_study(study_file())
        other = load_study(study_file(STUDY | {"title": "another", "methods": STUDY["methods"][:1]}))
        assert first.runs(first.points[0])[:4] == other.runs(other.points[0])[:4]

    @pytest.mark.parametrize(
        ("place", "value", "said"),
        [
            (["title"], "", "title: got ''"),
            (["scene"], "nowhere.toml", "need a TOML file or one of"),
            (["methods", 0, "model"], {"kind": "wrong"}, "kind"),
            (["methods", 0, "axes"], {"modes": [0]}, "levels start.displacement=0.01 modes=0: models[2].modes: got 0"),
            (["methods", 0, "axes"], {"nodes": [1]}, "models[2].nodes: got 1, need a known field"),
            (["methods", 0, "axes"], {"modes": []}, "methods[0].axes.modes"),
            (["axes"], {"start.displacment": [0.01]}, "need a known field"),
            (["axes"], {"title.words": [1]}, "title.words: got 'words' inside 'a small beam over a stop'"),
            (["methods", 1, "nearby"], {"method": [0.9]}, "nearby of stepwise: got 'method'"),
            (["methods", 1, "name"], "levels", "methods: got 'levels', need another name"),
            (["methods", 1, "name"], "reference", "methods: got 'reference', need another name"),
            (["methods"], [], "methods: "),
            (["maps"], ["nothing"], "maps: got 'nothing', need one of the methods"),
            (["time_limit_s"], 0, "time_limit_s: got 0"),
            (["methods", 0, "refine"], "step", "refine of levels: got 'step', need a field"),
            (["change"], {"models": [1]}, "models[0]: got 1"),
            (["change"], {"structure": "x"}, "structure: got 'x'"),
            (["tolerances"], [], "tolerances"),
            (["surprise"], 1, "surprise: got 1, need a known field"),
        ],
    )
    def test_a_wrong_file_is_one_line_that_names_it(self, study_file, place, value, said):
        with pytest.raises(MultiPhiValueError) as error:
            load_study(study_file(changed(place, value, STUDY) if place[0] in STUDY else STUDY | {place[0]: value}))
        assert said in str(error.value)
        assert "\n" not in str(error.value)

    def test_faults_of_axes_hide_none_of_a_method(self, study_file):
        data = changed(["methods", 1], STUDY["methods"][1] | {"axes": {"rtoll": [1e-5, 1e-6]}, "nearby": {}}, STUDY)
        data = changed(["methods", 0, "axes"], {"nodes": [1, 2]}, data) | {"axes": {"start.displacment": [0.01, 0.02]}}
        with pytest.raises(MultiPhiValueError) as error:
            load_study(study_file(data))
        for field in ("displacment", "nodes", "rtoll"):
            assert str(error.value).count(f"{field}: got") == 1

    def test_all_faults_of_methods_are_told_at_once(self, study_file):
        data = changed(["methods", 1, "axes"], {"rtoll": [1e-5]}, STUDY) | {"maps": ["nobody"]}
        with pytest.raises(MultiPhiValueError, match=r"maps: got 'nobody'.*; nearby of stepwise: got 'rtol'"):
            load_study(study_file(data))

    def test_an_unknown_study_is_told_the_known_ones(self):
        with pytest.raises(MultiPhiValueError, match="pareto"):
            load_study("paretto")

    @pytest.mark.parametrize("quick", [False, True])
    @pytest.mark.parametrize("name", SHIPPED)
    def test_the_shipped_studies_are_sound(self, name, quick):
        study = load_study(name, quick=quick)
        assert study.runs(study.points[0])

    def test_the_shipped_studies_are_these(self):
        assert tuple(shipped_studies()) == SHIPPED


class TestRunning:
    @pytest.fixture(scope="class")
    @classmethod
    def finished(cls, tmp_path_factory):
        """The small study, its store, and its result."""
        folder = tmp_path_factory.mktemp("finished")
        write(folder / "small.toml", SCENE)
        study = load_study(write(folder / "study.toml", STUDY))
        with Store(folder / "runs.sqlite") as opened, pytest.MonkeyPatch.context() as patch:
            patch.setattr(runners, "repeated", timing.repeated)
            patch.setattr(timing, "ROUNDS", timing.FEWEST_ROUNDS)
            yield study, opened, run_study(study, opened, progress=False)

    def test_rows_fronts_times_and_uncertainty(self, finished):
        _, _, result = finished
        assert len(result.rows) == 2 * (1 + 1 + 3 + 2)
        assert [row.message for row in result.rows if row.status != "ok"] == []
        found = settings(result)
        assert len(found) == 2 * 4
        for at in points(result):
            levels = settings_at(result, at).query("method == 'levels'")
            coarse, middle, fine = levels.error
            assert coarse > middle > fine > uncertainty(result, at) > 0
            assert (levels.online_s > 0).all()
            assert (levels.repeats_s.map(len) >= 3).all()
            assert levels.in_turns.sum() >= 2
            assert set(levels.repeats_s[levels.in_turns].map(len)) == {timing.FEWEST_ROUNDS}
        assert [(row.status, row.message) for row in result.turns] == 2 * [("ok", "")]
        assert all(s.measures["indicator"] > 0 for s in found.itertuples() if s.method == "levels")
        stepwise = [row for row in result.rows if row.parameters["method"] == "stepwise"]
        assert all(row.parameters["nearby"] == {} for row in result.timings)
        assert max(r.values["nrmse"]["0.08"]["tip"] for r in stepwise[:2]) == next(
            s.error for s in found.itertuples() if s.method == "stepwise"
        )

    def test_what_has_run_is_not_run_again(self, finished, monkeypatch):
        study, store, first = finished
        module = "multiphi_exudyn.study.accuracy.run_model"
        monkeypatch.setattr(module, lambda *given, **named: pytest.fail("run again"))
        again = run_study(study, store, progress=False)
        assert again.rows == first.rows
        assert again.timings == first.timings
        assert again.turns == first.turns

    def test_in_processes_as_in_this_one(self, study_file, tmp_path, store):
        study = load_study(study_file(STUDY | {"methods": STUDY["methods"][:1], "timing": False, "axes": {}}))
        here = run_study(study, store, progress=False)
        with Store(tmp_path / "other.sqlite") as other, open_executor("processes", 2) as executor:
            there = run_study(study, other, executor, progress=False)
        assert [(r.parameters, r.status, r.values) for r in here.rows] == [
            (r.parameters, r.status, r.values) for r in there.rows
        ]
        assert here.timings == there.timings == ()

    def test_nothing_runs_where_the_reference_failed_and_the_study_says_so(self, study_file, store):
        data = STUDY | {"reference": {"kind": "craig-bampton", "modes": 2, "step": 1e-4, "newton_tolerance": 1e-30}}
        result = run_study(load_study(study_file(data)), store, progress=False)
        assert [row.parameters["method"] for row in result.rows] == ["reference", "reference"]
        assert {row.status for row in result.rows} == {"failed"}

    def test_a_method_that_fails_is_a_gap_with_its_cause(self, study_file, store):
        data = changed(["methods", 1, "model"], {"kind": "craig-bampton", "modes": 2, "newton_tolerance": 1e-30}, STUDY)
        data = changed(["methods", 1, "axes"], {"step": [1e-4]}, data)
        data = changed(["methods", 1, "nearby"], {"step": [0.9]}, data) | {"axes": {}}
        result = run_study(load_study(study_file(data)), store, progress=False)
        failed = settings(result).query("method == 'stepwise'")
        assert failed.error.isna().all()
        assert failed.message.str.startswith("failed: ").all()
        assert settings(result).query("method == 'levels'").error.notna().all()

    def test_a_setting_that_is_none_at_a_later_point_is_a_gap_with_its_cause(self, store, monkeypatch):
        """Levels with printed frequencies are rigid: at that parameter set the compliant ones are refused."""
        monkeypatch.setattr("multiphi_exudyn.study.accuracy.run_model", at_rest)
        monkeypatch.setattr("multiphi_exudyn.study.accuracy.stiff_stops", lambda setup: None)
        study = load_study("sets", quick=True)
        result = run_study(study, store, progress=False)
        refused = {row.parameters["method"] for row in result.rows if "printed frequencies" in row.message}
        assert refused == {"Multi-Phi, compliant levels"}
        assert settings_at(result, study.points[-1]).message.str.startswith("failed: ").any()

    def test_rigid_levels_are_measured_against_a_stiff_stop_too_and_nothing_else_is(
        self, study_file, store, monkeypatch
    ):
        rigid = {"name": "rigid", "model": {"kind": "reduced", "contact": "rigid"}, "axes": {"modes": [4, 8]}}
        study = load_study(study_file(STUDY | {"methods": [STUDY["methods"][0], rigid], "axes": {}, "timing": False}))
        result = run_study(study, store, progress=False)
        found = {row.parameters["method"]: row.values.get("stiff_stops") for row in result.rows}
        assert found["reference"] is found["coarser"] is found["levels"] is None
        against = stiff_errors(result, {})
        assert [setting["modes"] for setting in against.setting] == [4, 8]
        assert (against.stiff_uncertainty == found["rigid"]["uncertainty"]["0.08"]["tip"]).all()
        monkeypatch.setattr("multiphi_exudyn.study.accuracy.stiff_stops", lambda setup: pytest.fail("run again"))
        assert run_study(study, store, progress=False).rows == result.rows

    def test_histories_are_kept_on_request(self, study_file, store):
        for keep in (False, True):
            data = STUDY | {"methods": STUDY["methods"][:1], "axes": {}, "histories": keep, "timing": False}
            data |= {"change": {"outputs.t_end": 0.08 if keep else 0.09}}
            study = load_study(study_file(data))
            run_study(study, store, progress=False)
            case = study.runs(study.points[0])[1]
            arrays = store.histories("error", case)
            assert (arrays is not None) == keep
        assert np.all(np.isfinite(arrays["points/tip"]))

    def test_maps_stand_beside_the_reference(self, study_file, store):
        data = STUDY | {"methods": STUDY["methods"][:1], "maps": ["levels"], "change": {"outputs.t_end": 1.0}}
        data |= {"axes": {}, "timing": False}
        result = run_study(load_study(study_file(data)), store, progress=False)
        (pair,) = result.maps
        assert pair.point == "tip"
        assert pair.full.amplitude.shape == pair.reduced.amplitude.shape
        assert np.allclose(pair.full.amplitude, pair.reduced.amplitude, atol=0.02 * np.max(pair.full.amplitude))
        assert set(pair.frequencies) == {"open", "stop closed"}
        study = load_study(study_file(data))
        scene = study.scene_for(study.runs({})[-1])
        period = prepare(scene).longest_period
        assert min(pair.frequencies["open"]) == pytest.approx(1 / period, rel=1e-9)
