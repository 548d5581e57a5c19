"""The report: complete, self-contained, and honest about what failed or is unknown."""

import base64
import itertools
import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_scene import BEAM, changed, write

import multiphi_exudyn as mp
from multiphi_exudyn import cli
from multiphi_exudyn.study import plots
from multiphi_exudyn.study.compare import Comparison, compare, histories, summary
from multiphi_exudyn.study.details import Details, details_of, level_modes
from multiphi_exudyn.study.measures import StiffStops
from multiphi_exudyn.study.report import contact_totals, embedded, findings, render
from multiphi_exudyn.study.runs import ModelRun
from multiphi_exudyn.study.scene import load_scene
from multiphi_exudyn.study.setup import prepare
from multiphi_exudyn.study.wording import engineering, percent, seconds, times

pytestmark = pytest.mark.usefixtures("few_elements")

FULL = {"kind": "full", "elements": 3, "step": 1e-4}
MODELS = [
    {"kind": "reduced", "name": "compliant-r{modes}"},
    {"kind": "reduced", "name": "rigid-r{modes}", "contact": "rigid"},
    {"kind": "user-object", "name": "body-r{modes}", "step": 1e-3},
    FULL | {"name": "full"},
    FULL | {"name": "full-coarser"},
    FULL | {"name": "full-cheap"},
    {"kind": "craig-bampton", "name": "component", "modes": 2, "step": 1e-4},
    {"kind": "craig-bampton", "name": "component-nearby", "modes": 2, "step": 9e-5},
    {"kind": "craig-bampton", "name": "finer-component", "modes": 4, "step": 1e-5},
]
PARTS = {"reference": "full", "coarser": "full-coarser", "cheapest": ["full-cheap"]}
ENVIRONMENT = {"python": "3", "versions": {"numpy": "2"}, "import_s": {"exudyn": 0.2, "multiphi_exudyn": None}}


@pytest.fixture(scope="module")
def setup(tmp_path_factory):
    data = changed(["outputs", "points"], ["middle", "tip"]) | {"models": MODELS, "comparison": PARTS}
    scene = load_scene(write(tmp_path_factory.mktemp("scene") / "small.toml", data))
    return prepare(scene)


@pytest.fixture(scope="module")
def comparison(setup):
    """Runs drawn by hand: every model is off by a known share, and takes a known time."""
    shares = dict(zip(setup.scene.models, (0.02, 0.2, 0.03, 0.0, 0.01, 0.04, 0.025, 0.05, 0.015), strict=True))
    times_s = dict(zip(setup.scene.models, (0.01, 0.01, 0.1, 10.0, 5.0, 1.0, 0.05, 0.05, 0.5), strict=True))
    runs = {name: drawn(setup, name, share, times_s[name]) for name, share in shares.items()}
    stiff = [
        {name: factor * values for name, values in runs["rigid-r6"].points.items()} for factor in (1.03, 1.02, 1.01)
    ]
    return Comparison(setup, runs, ENVIRONMENT, StiffStops((1e8, 1e9, 1e10), tuple(stiff)))


def drawn(setup, name, share, online_s):
    tip = 1e-2 * np.cos(60 * setup.time)
    return ModelRun(
        name,
        setup.scene.models[name].kind,
        f"model {name}, {'rigid' if name.startswith('rigid') else 'compliant'} levels",
        dofs=6,
        time=setup.time,
        points={"tip": (1 + share) * tip, "middle": (1 + share / 2) * tip},
        gaps={"stop": 1e-3 + tip},
        contact_force={"stop": np.maximum(0, -tip)},
        contact_intervals={"stop": np.array([[0.03, 0.032], [0.034, 0.04]])},
        impulse={"stop": 0.5},
        energy_time=setup.time,
        energy=np.exp(-setup.time),
        ledger={"initial": 1.0, "damping": 0.1, "final": 0.9, "residual": 0.0},
        steps=100,
        first_s=2 * online_s,
        repeats_s=(online_s, 3 * online_s, 0.5 * online_s),
    )


@pytest.fixture(scope="module")
def page(comparison, pictures):
    with pictures():
        return render(comparison, details_of(comparison))


def text_of(page):
    """What is read: without tags and pictures."""
    return " ".join(re.sub(r"<style>.*?</style>|<script.*?</script>|<[^>]+>", " ", page, flags=re.DOTALL).split())


def test_the_first_lines_give_the_errors_times_and_doubts(comparison):
    found = findings(comparison)
    assert not [text for texts in found.values() for text in texts if re.search(r"[a-z)]\.[A-Z]", text)]
    compared, outcome, doubts = (" ".join(found[part]) for part in ("compared", "outcome", "distrust"))
    assert "deflects tip by +10 mm" in compared
    assert "stop (gap 1 mm, 100 kN/m)" in compared
    assert "by 2.00 % to 0.1 s (NRMSE, worst of middle and tip)" in outcome
    assert (
        "takes 10 ms: 100 times faster than the cheapest fair full model (4.00 %), 5 times faster than Exudyn's own "
        "linear component at its cheapest (5.00 %), 50 times faster than where it is as accurate (1.50 %), "
        "1000 times faster than the reference" in outcome
    )
    assert "coarser copy of itself by 1.00 % to 0.1 s" in doubts
    assert "Rigid levels are the limit of stiff stops" in doubts


def test_rigid_levels_are_measured_against_stiff_stops_in_a_table(page):
    text = text_of(page)
    assert "Rigid levels against stiff stops" in text
    assert re.search(r"rigid-r6 [\d.]+ % 2.91 %", text)
    assert re.search(r"own uncertainty [\d.]+ % 1.98 %", text)


def test_the_key_figures_are_the_uncertainty_and_the_speed_ups(comparison):
    figures = [tuple(row.split(" | ")[:2]) for row in findings(comparison)["key_figures"]]
    assert ("Exudyn's own linear component", "5.00 %") in figures  # its setting of 2 modes, the worse of its two steps
    assert dict(figures) == {
        "the reference's own uncertainty": "1.00 %",
        "the full model at its cheapest fair setting": "4.00 %",
        "Exudyn's own linear component": "1.50 %",
        "compliant-r6 over the reference": "1000 times faster",
        "compliant-r6 over the cheapest fair full model": "100 times faster",
        "compliant-r6 over the linear component at its cheapest": "5 times faster",
        "compliant-r6 over the linear component where it is as accurate": "50 times faster",
        "body-r6 over the reference": "100 times faster",
        "body-r6 over the cheapest fair full model": "10 times faster",
        "body-r6 over the linear component at its cheapest": "2 times slower",
        "body-r6 over the linear component where it is as accurate": "5 times faster",
        "body-r6 against compliant-r6": "0.98 %",
    }


def test_the_page_holds_its_pictures_and_points_nowhere_else(page):
    sources = re.findall(r'src="([^"]*)"', page)
    assert len(sources) == 9  # two points, error over time, contact, energy, modes, initial shape, maps, long after
    assert all(source.startswith("data:image/png;base64,iVBOR") for source in sources)
    assert not re.search(r"href=\"|url\(|src=\"h|http", page)


def test_the_page_has_the_samples_of_its_histories_and_names_cannot_end_their_element(comparison):
    page = render(comparison, Details())
    text = re.search(r'<script type="application/json" id="zoom-data">(.*?)</script>', page, re.DOTALL)[1]
    data = json.loads(text)
    assert [plot["label"] for plot in data] == ["middle [mm]", "tip [mm]", "force of stop [N]"]
    line = next(each for each in data[1]["lines"] if each["name"] == "compliant-r6")
    values = np.frombuffer(base64.b64decode(line["data"]), dtype="<f4")
    assert values == pytest.approx(1e3 * comparison.runs["compliant-r6"].points["tip"], rel=1e-6)
    assert data[1]["x"]["start"] + data[1]["x"]["step"] * (len(values) - 1) == pytest.approx(comparison.setup.t_end)
    assert data[2]["shade"] == [[0.03, 0.032], [0.034, 0.04]]
    assert "<" not in embedded({"name": "</script>"})
    assert json.loads(embedded({"name": "</script>"})) == {"name": "</script>"}


def test_the_headline_is_the_fastest_model_that_is_accurate(comparison):
    exact = replace(comparison.runs["compliant-r6"], name="rigid-r6", label="slower and exact", repeats_s=(0.1,))
    points = {name: 1.001 * values for name, values in comparison.reference.points.items()}
    told = replace(comparison, runs=dict(comparison.runs) | {"rigid-r6": replace(exact, points=points)})
    outcome = " ".join(findings(told)["outcome"])
    assert outcome.startswith("slower and exact differs from the reference by 0.1 %")
    assert outcome.index("slower and exact") < outcome.index("model compliant-r6")


def test_the_page_names_every_model_metric_and_level(page, comparison):
    text = text_of(page)
    for wanted in (*comparison.runs, "NRMSE", "agreement horizon", "stop closed", "Unaccounted"):
        assert wanted in text


def test_the_summary_is_json_with_the_agreed_keys(comparison):
    content = json.loads(json.dumps(summary(comparison), allow_nan=False))
    assert set(content) == {
        "scene", "environment", "reference", "models", "reference_uncertainty", "errors",
        "agreement_horizon_s", "contact_intervals", "ledger", "stiff_stops",
    }  # fmt: skip
    assert content["stiff_stops"]["errors"]["rigid-r6"]["0.1"]["tip"] == pytest.approx(0.03 / 1.03)
    assert content["stiff_stops"]["uncertainty"]["0.1"]["tip"] == pytest.approx(0.02 / 1.01)
    assert content["reference"] == "full"
    model = content["models"]["compliant-r6"]
    wanted = {"kind": "reduced", "dofs": 6, "status": "ok", "message": "", "steps": 100, "online_s": 0.01}
    assert wanted.items() <= model.items()
    assert model["speedup"] == pytest.approx(1000)
    assert content["errors"]["compliant-r6"]["0.1"]["tip"] == pytest.approx(0.02)
    assert content["reference_uncertainty"]["0.1"]["tip"] == pytest.approx(0.01)
    assert content["agreement_horizon_s"]["compliant-r6"] == {"0.01": 0.0, "0.05": 0.1}
    assert content["contact_intervals"]["full"]["stop"] == [[0.03, 0.032], [0.034, 0.04]]


def test_the_histories_are_arrays_on_one_grid(comparison):
    arrays = histories(comparison)
    assert arrays["rigid-r6/point/tip"].shape == arrays["time"].shape
    assert {"full/gap/stop", "full/force/stop", "full/energy", "full/energy_time"} <= set(arrays)


def test_without_rigid_levels_no_stiff_stop_is_told_of(comparison):
    plain = replace(comparison, stiff=None)
    assert "stiff" not in " ".join(findings(plain)["distrust"])
    assert "Rigid levels" not in text_of(render(plain, Details()))
    assert summary(plain)["stiff_stops"] == {}


def test_a_stiff_stop_that_failed_is_told_with_its_cause(comparison):
    spoiled = replace(comparison, stiff=StiffStops((1e8, 1e9, 1e10), (), "chatter at 0.1 s"))
    assert "the run with stiff stops failed: chatter at 0.1 s" in " ".join(findings(spoiled)["distrust"])
    assert summary(spoiled)["stiff_stops"]["errors"] == {}
    assert "Rigid levels against stiff stops" not in text_of(render(spoiled, Details()))


def test_windows_end_with_the_run_and_the_headline_takes_the_longest_that_fits(comparison):
    def with_end(t_end):
        time = 1e-3 * np.arange(round(t_end / 1e-3) + 1)
        return replace(comparison, setup=replace(comparison.setup, time=time))

    assert [with_end(t_end).setup.windows for t_end in (0.05, 0.3, 1.0)] == [(0.05,), (0.1, 0.3), (0.1, 0.3, 1.0)]
    assert [with_end(t_end).headline_window for t_end in (0.05, 0.3, 1.0)] == [0.05, 0.3, 0.3]


def test_a_failed_model_is_a_row_with_its_cause(comparison):
    failed = ModelRun("rigid-r6", "reduced", "rigid", status="failed", message="chatter <at> 0.1 s")
    spoiled = replace(comparison, runs=dict(comparison.runs) | {"rigid-r6": failed})
    assert "Failed: rigid-r6 (chatter <at> 0.1 s)" in " ".join(findings(spoiled)["outcome"])
    assert "failed: chatter &lt;at&gt; 0.1 s" in render(spoiled, Details())
    content = summary(spoiled)
    assert content["models"]["rigid-r6"]["speedup"] is None
    assert "rigid-r6" not in content["errors"]


def test_without_its_reference_the_report_says_so_and_measures_nothing(comparison):
    failed = ModelRun("full", "full", "full beam", status="failed", message="no convergence at 0.02 s")
    spoiled = replace(comparison, runs=dict(comparison.runs) | {"full": failed})
    text = text_of(render(spoiled, Details(levels=level_modes(spoiled))))
    assert "The reference failed, so there are no errors: no convergence at 0.02 s" in text
    content = summary(spoiled)
    assert content["errors"] == {} == content["reference_uncertainty"] == content["agreement_horizon_s"]


def test_without_a_coarser_copy_the_uncertainty_is_called_unknown(comparison, pictures):
    failed = ModelRun("full-coarser", "full", "full beam", status="failed", message="stopped")
    spoiled = replace(comparison, runs=dict(comparison.runs) | {"full-coarser": failed})
    assert "uncertainty is unknown" in " ".join(findings(spoiled)["distrust"])
    assert summary(spoiled)["reference_uncertainty"] == {}
    with pictures():
        assert plots.png(plots.error_time_figure(spoiled)).startswith(b"\x89PNG")


def test_a_busy_machine_is_told_with_its_load(comparison, capsys):
    alone, busy = (replace(comparison, environment={"cores": 4, "load_average": load}) for load in (3.9, 11.25))
    assert "Compare ratios" in findings(alone)["distrust"][-1]
    assert "the load average rose to 11 on 4 cores" in findings(busy)["distrust"][-1]
    cli._print_comparison(busy, Path())
    assert "the load average rose to 11 on 4 cores" in capsys.readouterr().out


def test_a_page_says_where_its_points_are(comparison, setup):
    assert "clamp: middle 300 mm, tip 500 mm." in " ".join(findings(comparison)["compared"])


def test_lines_that_coincide_are_all_seen(comparison):
    """Each is narrower than those drawn before it, or a row of dots."""
    grey = comparison.nearby | {name for name, run in comparison.runs.items() if run.kind == "full"}
    lines = [style for name, style in plots.styles(comparison).items() if name not in grey]
    widths = [style.width for style in lines if style.line == "-"]
    assert all(a > b for a, b in itertools.pairwise(widths))
    assert plots.styles(comparison)["full"].width > max(widths)


def test_pictures_leave_no_global_state(comparison):
    plots.history_figure(comparison, "tip")
    pyplot = sys.modules.get("matplotlib.pyplot")  # loaded by another library, if at all
    assert pyplot is None or pyplot.get_fignums() == []


def test_every_model_keeps_its_colour_and_the_reference_is_black(comparison):
    drawn = plots.styles(comparison)
    assert drawn["full"].colour == "#000000"
    own = [
        drawn[name].colour
        for name, run in comparison.runs.items()
        if run.kind != "full" and name not in comparison.nearby
    ]
    assert len(set(own)) == len(own)


def test_a_scene_of_matrices_is_compared_without_shapes(tmp_path):
    stiffness = np.array([[300.0, -100.0], [-100.0, 100.0]])
    np.savez(tmp_path / "two.npz", mass=np.eye(2), stiffness=stiffness)
    data = changed(["structure"], {"matrices": "two.npz", "points": {"middle": 0, "tip": 1}})
    data["start"] = {"load_at": "tip", "force": 1.0}
    data["outputs"]["t_end"] = 2.0
    scene = load_scene(write(tmp_path / "matrices.toml", changed(["models", 1, "modes"], 1, data)))
    compared = compare(prepare(scene), {}, progress=False)
    assert [run.status for run in compared.runs.values()] == ["ok", "ok"]
    assert compared.environment["load_average"] >= 0
    assert level_modes(compared) == ()
    page = text_of(render(compared, details_of(compared)))
    assert "A static force of +1 N at tip" in page
    assert "Offline: time to compute modes and the static start; the matrices are given." in page


def test_modes_along_the_beam_have_the_frequencies_of_the_runs(setup, comparison):
    free, closed = level_modes(comparison)
    assert free.frequencies[0] == pytest.approx(1 / setup.longest_period)
    assert np.all(np.diff(np.ravel(np.column_stack([free.frequencies, closed.frequencies]))) >= 0)
    own = mp.MultiPhiModel(setup.structure, setup.mechanics.contacts, modes=4).level(("stop",))
    assert closed.frequencies == pytest.approx(own.frequencies)
    row = setup.structure.row("middle") @ own.shapes / np.max(np.abs(setup.structure.row("tip") @ own.shapes[:, 0]))
    (beam,) = closed.beams
    assert abs(np.interp(0.3, beam.x, beam.shapes[0])) == pytest.approx(abs(row[0]), rel=1e-2)
    assert beam.contacts == (0.3,)
    assert (free.share, closed.share) == pytest.approx((0.92, 0.08))


def test_modes_of_several_beams_are_of_the_levels_the_reference_held_longest(tmp_path):
    parts = dict.fromkeys("abc", BEAM["structure"]["beam"])
    directions = {"ab": {"a.tip": 1.0, "b.tip": -1.0}, "bc": {"b.tip": 1.0, "c.tip": -1.0}}
    given = {"gap": 1e-3, "stiffness": 1e4}
    data = changed(["structure"], {"beams": parts}) | {
        "contacts": [{"name": name, "direction": at} | given for name, at in directions.items()],
        "start": {"load_at": "a.tip", "measured_at": "a.tip", "displacement": 0.01},
        "outputs": {"t_end": 0.2, "points": ["a.tip"], "interval": 1e-3},
        "models": [{"kind": "reduced", "name": name, "modes": int(name[1:])} for name in ("r24", "r12")],
        "comparison": {"reference": "r24"},
    }
    scene = load_scene(write(tmp_path / "three.toml", data))
    compared = compare(prepare(scene), {}, progress=False)
    levels = level_modes(compared)
    assert levels[0].closed == ()
    assert sum(level.share for level in levels) == pytest.approx(1)
    longest = [level.share for level in levels[1:]]
    assert len(longest) > 1
    assert longest == sorted(longest, reverse=True)
    for level in levels:
        assert [beam.name for beam in level.beams] == ["a", "b", "c"]
        assert np.max([np.abs(beam.shapes) for beam in level.beams], axis=(0, 2)) == pytest.approx(np.ones(4))
    touching = next(level for level in levels if level.closed == ("ab",))
    first, second, _ = (beam.shapes[0][-1] for beam in touching.beams)
    assert first == pytest.approx(second, rel=0.05)
    page = render(compared, Details(levels=levels))
    assert page.count("data:image/png") == 1 + 1 + 2 + 1 + 1
    assert "the contact ab between a.tip and b.tip (gap 1 mm, 10 kN/m)" in text_of(page)


def test_many_contacts_are_told_of_together(tmp_path):
    points = {"p{i}": {"first": 0.1, "last": 0.5, "count": 6}, "tip": 0.5}
    rows = [{"name": "s{i}", "direction": "p{i}", "gap": 1e-3, "stiffness": 1e4, "count": 6}]
    beam = BEAM["structure"]["beam"] | {"points": points}
    data = changed(["structure", "beam"], beam) | {"contacts": rows}
    data = changed(["outputs"], {"t_end": 0.1, "points": ["tip"], "interval": 1e-3}, data)
    scene = load_scene(write(tmp_path / "bed.toml", data))
    compared = compare(prepare(scene), {}, progress=False)
    page = render(compared, details_of(compared))
    assert page.count("data:image/png") == 1 + 1 + 1 + 1 + 1 + 1
    assert "meets 6 contacts from s1 to s6 (gap 1 mm, 10 kN/m each)" in text_of(page)
    totals = contact_totals(compared).loc[compared.reference.name]
    assert 1 < totals["most at once"] <= totals["contacts touched"] <= 6
    assert totals["contacts made"] == sum(len(given) for given in compared.reference.contact_intervals.values())
    assert totals["impulse of all"] == f"{sum(compared.reference.impulse.values()):.4g} N s"
    assert "Of 6 contacts." in text_of(page)


@pytest.mark.parametrize(
    ("function", "value", "expected"),
    [
        (percent, 0.1264, "12.6 %"), (percent, 0.02321, "2.32 %"), (percent, 0.00018, "0.02 %"),
        (percent, 0.0, "0 %"), (percent, None, "–"), (percent, float("nan"), "–"),
        (seconds, 10.24, "10.2 s"), (seconds, 0.0252, "25.2 ms"), (seconds, 2.5e-5, "25 µs"),
        (times, 404.4, "404 times"), (times, 3.14, "3.1 times"), (times, None, "–"),
        (engineering, 1e6, "1 M"), (engineering, 2.5e4, "25 k"), (engineering, 12.0, "12 "),
    ],
)  # fmt: skip
def test_numbers_are_written_with_the_unit_that_reads_best(function, value, expected):
    assert function(value) == expected
