"""The study's page and pictures: complete, self-contained, and honest about gaps and what is not known."""

import base64
import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from small_study import METHODS, coarser, contact, in_turns, map_pairs, result_of, row, small_study, timing

from multiphi_exudyn.study import accuracy_report
from multiphi_exudyn.study.accuracy import cheapest, over_all_points, settings
from multiphi_exudyn.study.accuracy_report import (
    along_figure,
    convergence_figure,
    error_text,
    findings,
    pareto_figure,
    render_study,
    response_figure,
    shown_points,
    styles,
)
from multiphi_exudyn.study.plots import map_figure
from multiphi_exudyn.study.wording import percent

AXIS = {"start.displacement": [-0.01, 0.02]}
STEP = {"step": 1e-4}


@pytest.fixture(scope="module")
def result():
    return small_study(maps=map_pairs())


@pytest.fixture(scope="module")
def page(result, pictures):
    with pictures():
        return render_study(result)


def text_of(page):
    """What is read: without tags and pictures."""
    return " ".join(re.sub(r"<style>.*?</style>|<[^>]+>", " ", page, flags=re.DOTALL).split())


def headings(page):
    return re.findall(r"<h2>(.*?)</h2>", page)


def lines_of(axes, colour):
    """Data of the lines of one colour, those with a solid line only."""
    drawn = [line for line in axes.lines if to_rgba(line.get_color()) == to_rgba(colour)]
    return [np.column_stack(line.get_data()) for line in drawn if line.get_linestyle() == "-"]


def texts_of(figure):
    """What is written in a picture, its legend included."""
    written = [
        *(text for axes in figure.axes for text in axes.texts),
        *(t for e in figure.legends for t in e.get_texts()),
    ]
    return " ".join(text.get_text() for text in written)


def test_the_first_lines_say_what_was_asked_what_came_out_and_what_to_distrust(result):
    found = findings(result)
    (compared,) = found["compared"]
    assert "What are the error and the run time of 4 methods, at 35 settings in all" in compared
    assert "NRMSE to 0.3 s, the worst of node2, node3 and of each setting's nearby runs" in compared
    assert "the reference (reference, in words)" in compared
    assert found["outcome"] == (
        "The cheapest within 10 % is Multi-Phi (r = 3): 275 µs, 2909 times faster than the cheapest full model "
        "that does.",
        "The cheapest within 5 % is Multi-Phi (r = 4): 300 µs, 2667 times faster than the cheapest full model "
        "that does.",
        "The cheapest within 2 % is Multi-Phi (r = 6): 350 µs, 9143 times faster than the cheapest full model "
        "that does.",
        "The cheapest within 1 % is Multi-Phi (r = 8): 400 µs, 8000 times faster than the cheapest full model "
        "that does.",
        "The most accurate is Multi-Phi (r = 16): 0.12 %.",
    )
    doubts = " ".join(found["distrust"])
    assert (
        "coarser copy of itself by 0.10 %. Smaller errors are not significant. The two agree to 1 % until 0.25 s"
        in doubts
    )
    assert "2 of 85 runs failed or took too long. Settings without an error: 1 of 35." in doubts
    assert "short form" not in doubts


def test_the_short_form_and_an_unknown_uncertainty_are_told():
    doubts = " ".join(findings(result_of([row("a", 0.1)], quick=True, assumptions=()))["distrust"])
    assert "the study's short form" in doubts
    assert "uncertainty is unknown" in doubts
    assert "Assumptions" not in doubts
    assert "A reference failed" in " ".join(findings(result_of([row("reference", status="failed")]))["distrust"])


def test_what_was_timed_in_turns_is_told():
    rows, timings = [row("a", 0.1), row("b", 0.1)], [timing("a", 1.0), timing("b", 1.1)]
    turns = (in_turns([("a", {}, [1.0] * 9), ("b", {}, [1.1] * 8 + [9.9])]),)
    found = findings(result_of(rows, timings, turns=turns))
    told = found["timing"][-1]
    assert "differ most" not in " ".join(found["distrust"])  # no quartile depends on the longest time
    assert told.startswith(
        "Of these, 2 settings within a tolerance, in at most 10 times the time of the cheapest, were"
    )
    assert "in 9 rounds" in told
    assert "2 machines" not in " ".join(found["distrust"])
    elsewhere = (replace(turns[0], environment=turns[0].environment | {"host": "another"}),)
    assert "2 machines" in " ".join(findings(result_of(rows, timings, turns=elsewhere))["distrust"])
    assert "turns" not in " ".join(findings(result_of(rows, timings))["timing"])


def test_what_lies_below_the_uncertainty_is_told_as_that():
    given = result_of([row("reference"), row("coarser", 0.03), row("a", 0.02)], [timing("a", 1.0)])
    assert "Which settings are within 2 %, 1 % cannot be decided here." in " ".join(findings(given)["distrust"])
    assert findings(given)["outcome"][-1] == "The most accurate is a: ≤ 3.00 % (uncertainty)."
    assert error_text(0.04, 0.03) == "4.00 %"
    assert error_text(None, 0.03) == "–"
    assert error_text(0.02, None) == "2.00 %"


def test_without_a_full_model_that_holds_the_tolerance_nothing_is_called_faster():
    rows = [row("Multi-Phi", 0.001, setting={"modes": 8}), row("full ANCF", 0.5, setting={"elements": 4})]
    timings = [timing("Multi-Phi", 1e-3, setting={"modes": 8}), timing("full ANCF", 1.0, setting={"elements": 4})]
    with_full = findings(result_of(rows, timings))["outcome"][0]
    assert with_full == "The cheapest within 10 % is Multi-Phi (r = 8): 1 ms; no full model does."
    alone = findings(result_of(rows, timings, methods=METHODS[:1]))["outcome"][0]
    assert alone == "The cheapest within 10 % is Multi-Phi (r = 8): 1 ms."
    full = findings(result_of([row("full ANCF", 0.05)], [timing("full ANCF", 1.0)]))["outcome"][0]
    assert full == "The cheapest within 10 % is full ANCF: 1 s."
    nobody = findings(result_of([row("Multi-Phi", 0.9)], [timing("Multi-Phi", 1.0)]))["outcome"][0]
    assert nobody == "No setting is within 10 %."


def test_choices_stand_in_the_order_of_their_times(result):
    found = cheapest(result, {}, 0.02)
    assert list(found.method) == ["Multi-Phi", "Craig-Bampton", "full ANCF", "Multi-Phi, rigid"]
    assert list(found.online_s.isna()) == [False, False, False, True]
    assert found.faster[2] == 1


def test_every_section_with_data_appears_in_its_place(page):
    assert headings(page) == [
        "Error against run time",
        "The cheapest model for a tolerance",
        "Convergence",
        "Time-frequency maps",
        "Failed runs",
        "How errors and times were computed",
        "Assumptions",
        "Definitions",
        "Machine and versions",
    ]


def test_rigid_levels_stand_beside_a_stiff_stop():
    stiff = {"stiffness": [1e8, 1e9, 1e10], "errors": {"0.3": {"node2": 0.005, "node3": 0.011}}}
    stiff["uncertainty"] = {"0.3": {"node2": 0.009, "node3": 0.01}}
    rows = [row("reference"), coarser({}), row("Multi-Phi, rigid", 0.12, setting={"modes": 6}, stiff_stops=stiff)]
    result = result_of([*rows, row("Multi-Phi", 0.01, setting={"modes": 6})])
    told = " ".join(findings(result)["distrust"])
    assert "Rigid levels are the limit of stiff stops" in told
    assert "Multi-Phi, rigid r = 6 12.0 % 1.10 % own uncertainty 0.10 % 1.00 %" in text_of(render_study(result))


def test_sections_without_data_do_not_appear():
    bare = render_study(result_of([row("reference"), row("a", 0.1)], assumptions=()))
    assert headings(bare) == ["How errors and times were computed", "Definitions", "Machine and versions"]
    assert "timing pass runs" not in text_of(bare)


def test_the_page_holds_its_pictures_and_points_nowhere_else(page):
    sources = re.findall(r'src="([^"]*)"', page)
    assert len(sources) == 3  # error over time, convergence, maps
    assert all(source.startswith("data:image/png;base64,iVBOR") for source in sources)
    assert not re.search(r"href=\"|url\(|<script src|http", page)


def numbers(text):
    return np.frombuffer(base64.b64decode(text), dtype="<f4")


def test_the_page_says_the_first_lines(page, result):
    found, text = findings(result), text_of(page)
    for sentence in (*found["compared"], *found["outcome"], *found["distrust"]):
        assert sentence in text.replace("&#39;", "'")


def test_names_and_causes_are_escaped(page):
    assert "A &lt;small&gt; study" in page
    assert "Newton &lt;did not&gt; converge" in page
    assert "The support is &lt;stiff&gt;." in page


def test_the_table_of_the_cheapest_gives_setting_error_times_and_factor(page):
    text = text_of(page)
    assert "Multi-Phi r = 6 1.36 % 350 µs 9143 315 µs to 455 µs 700 µs 300 ms" in text
    assert "full ANCF 8 elements, step 20 µs 0.70 % 3.2 s 1 2.88 s to 4.16 s 6.4 s 300 ms" in text
    assert "Multi-Phi, rigid none of its settings" in text


def test_failures_are_listed_with_place_and_cause(page):
    text = text_of(page)
    assert "full ANCF 16 elements, step 160 µs step × 0.93 – failed Newton &lt;did not&gt; converge" in text
    assert text.count("Newton &lt;did not&gt; converge") == 2


def test_many_failures_are_cut_short_and_counted(monkeypatch):
    monkeypatch.setattr(accuracy_report, "MOST_FAILURES", 2)
    rows = [row("a", setting={"modes": i}, status="failed", message="why") for i in range(5)]
    text = text_of(render_study(result_of(rows)))
    assert text.count("failed why") == 2
    assert "3 more are in runs.csv" in text


def test_how_it_was_measured_is_told_with_its_numbers(page):
    text = text_of(page)
    assert "36 settings timed, 3 repeats each." in text
    assert "OMP_NUM_THREADS = 1, Python 3, numpy 2, exudyn 1." in text
    assert "A run may take 300 s" in text


def test_along_the_scene_every_quantity_has_a_table():
    page = render_study(small_study(AXIS, METHODS[:1], timings=()))
    assert "Along start.displacement" in headings(page)
    text = text_of(page)
    assert "error -0.01 0.02 coarser 0.10 % 0.10 % Multi-Phi 0.16 % 0.21 %" in text
    assert "losses of contact inside the first contact phase, stop -0.01 0.02 reference 0 0" in text
    assert "first contact, stop -0.01 0.02 reference 30.000 ms 30.000 ms" in text


def test_with_several_points_every_method_has_one_line_its_best_setting_over_all_of_them():
    result = small_study(AXIS, METHODS[:1])
    errors = [s.error for s in settings(result).itertuples() if s.setting == {"modes": 16}]
    (line,) = findings(result)["outcome"]
    assert line.startswith("Multi-Phi (r = 16): error ")
    assert f"at most {percent(max(errors))}, at all 2 points; 600 µs in the median" in line
    table = over_all_points(result)
    worst = table[table.setting == "r = 16"].iloc[0]
    assert (worst.points, worst.worst) == (2, max(errors))
    assert worst["median"] == pytest.approx(sum(errors) / 2)
    assert "Every setting, over all 2 points" in headings(render_study(result))


def test_the_picture_of_the_response_has_a_line_for_each_value_of_the_second_axis():
    places = [{"gap": g, "stiffness": k, "load": f} for g in (1.0, 2.0) for k in (1.0, 10.0, 100.0) for f in (3.0, 4.0)]
    rows = [
        row("reference", at=at, largest={"node3": at["gap"]}, largest_force={"stop": at["stiffness"]}) for at in places
    ]
    figure = response_figure(result_of([*rows, row("a", 0.1, places[0])]))
    assert len(figure.axes) == 4
    assert [axes.get_title("left") for axes in figure.axes[:2]] == ["load = 3", "load = 4"]
    displacement, _, force, _ = figure.axes
    assert [list(line.get_ydata()) for line in displacement.lines] == 3 * [[1e3, 2e3]]
    assert [list(line.get_ydata()) for line in force.lines] == [[1.0, 1.0], [10.0, 10.0], [100.0, 100.0]]
    assert response_figure(small_study(AXIS, METHODS[:1])) is None


def test_many_points_are_cut_short_and_counted():
    rows = [run for x in range(9) for run in (coarser({"load": float(x)}), row("a", 0.1, {"load": float(x)}))]
    given = result_of(rows, [timing("a", 1.0, {"load": 7.0})])
    assert shown_points(given) == [{"load": 7.0}]
    assert len(shown_points(result_of(rows))) == 6
    assert "The sections below show 1 of the 9 points of the scene's axes" in text_of(render_study(given))


def test_every_method_keeps_its_colour_and_marker_and_full_models_are_neutral(result):
    drawn = styles(result)
    assert len({style.colour for style in drawn.values()} - {"#000000"}) == 4
    assert drawn["full ANCF"].colour == "#000000"
    assert styles(small_study(AXIS)) == drawn


def test_the_picture_of_error_and_time_holds_fronts_gaps_and_the_uncertainty(result):
    figure = pareto_figure(result, {})
    axes, colour = figure.axes[0], styles(result)["full ANCF"].colour
    (line,) = lines_of(axes, colour)
    assert np.all(np.diff(line[:, 0]) > 0)
    assert np.all(np.diff(line[:, 1]) < 0)
    crosses = [mark for mark in axes.lines if mark.get_marker() == "x"]
    assert [len(mark.get_xdata()) for mark in crosses] == [1]
    text = texts_of(figure)
    assert "× failed: 1" in axes.get_title(loc="left")
    assert "the reference's own uncertainty" in text
    assert "the reference itself" in text
    assert all(name in text for name in ("Multi-Phi, rigid", "Craig-Bampton", "full ANCF", "10 %", "2 %"))
    lowest, highest = axes.get_ylim()
    assert lowest < 0.1 < 40 < highest


def test_convergence_shows_every_numeric_field_with_orders_and_gaps(result):
    figure = convergence_figure(result, {})
    assert [axes.get_xlabel() for axes in figure.axes] == ["modes r", "step", "elements"]
    labels = [text.get_text() for axes in figure.axes for text in axes.get_legend().get_texts()]
    assert "Multi-Phi\norder 2.5, 2.5, 2.5, 2.5, 2.5" in labels
    assert "full ANCF (16 elements)\norder 2.0, 2.0" in labels
    assert any(line.get_marker() == "x" for line in figure.axes[1].lines)
    assert convergence_figure(result_of([row("a", 0.1)]), {}) is None


def test_the_figure_along_an_axis_leaves_gaps_where_runs_failed():
    rows = [row("a", 0.1, {"load": 1.0}, **contact(2)), row("a", None, {"load": 2.0}, status="failed")]
    rows += [row("a", 0.2, {"load": 3.0}, **contact(4)), row("reference", at={"load": 1.0}, **contact(1))]
    error, losses = along_figure(result_of(rows), "load").axes
    heights = next(line.get_ydata() for line in error.lines if line.get_label() == "a")
    assert np.array_equal(heights, [10.0, np.nan, 20.0], equal_nan=True)
    assert next(list(line.get_ydata()) for line in losses.lines if line.get_label() == "a")[::2] == [2, 4]


def test_maps_stand_side_by_side_with_the_levels_named_once():
    figure = map_figure(map_pairs())
    maps = figure.axes[:6]
    assert [axes.get_title() for axes in maps[:2]] == ["the reference", "Multi-Phi, r = 6"]
    assert [axes.get_ylabel() for axes in maps[::2]] == [f"{p}: frequency [Hz]" for p in ("node1", "node2", "node3")]
    assert texts_of(figure) == "open: 4, 37, 109 Hz stop: 17, 80 Hz"
    assert {len(axes.lines) for axes in maps} == {5}
    assert all(mesh.get_clim() == (-60.0, 0.0) for axes in maps for mesh in axes.collections[:1])


def test_equal_colours_of_a_row_mean_equal_amplitudes():
    pair = map_pairs()[0]
    quiet = replace(pair, reduced=replace(pair.full, amplitude=0.1 * pair.full.amplitude))
    full, reduced = (axes.collections[0].get_array() for axes in map_figure([quiet]).axes[:2])
    assert np.max(full) == pytest.approx(0)
    assert np.max(reduced) == pytest.approx(-20)


def test_lasting_settings_have_a_table_of_their_own():
    methods = [m | ({"refine": "step"} if "step" in m["axes"] else {}) for m in METHODS]
    told = render_study(small_study(methods=methods))
    assert told.count("times faster than the full model") == 2 * render_study(small_study()).count(
        "times faster than the full model"
    )
    assert "full model that does. Every finer setting holds it too." in told


def test_a_setting_that_does_not_last_is_named_beside_one_that_does():
    rows = [row("m", error, setting={"modes": r}) for r, error in ((4, 0.009), (6, 0.03), (8, 0.008), (9, 0.02))]
    timings = [timing("m", 1e-3 * r, setting={"modes": r}) for r in (4, 6, 8, 9)]
    methods = [{"name": "m", "model": {"kind": "reduced"}, "refine": "modes"}]
    told = findings(result_of(rows, timings, methods))["outcome"]
    assert told[1:4] == (
        "The cheapest within 5 % is m (r = 4): 4 ms. Every finer setting holds it too.",
        "The cheapest within 2 % is m (r = 4): 4 ms; where every finer setting has to hold it too, m (r = 8): 8 ms.",
        "The cheapest within 1 % is m (r = 4): 4 ms; where every finer setting has to hold it too, none.",
    )
