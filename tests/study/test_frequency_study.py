"""Frequencies that a study's responses show: tables and words from rows of known numbers, and a study that runs."""

import re

import numpy as np
import pytest
from small_scene import BEAM, changed, write
from small_study import result_of, row

from multiphi_exudyn.study.accuracy.cases import load_study
from multiphi_exudyn.study.accuracy.frequency_changes import ideal_of, rate_uncertainty, shown_of
from multiphi_exudyn.study.accuracy.frequency_figure import frequency_figure
from multiphi_exudyn.study.accuracy.frequency_findings import frequency_asked, frequency_outcome, signed
from multiphi_exudyn.study.accuracy.study import run_study
from multiphi_exudyn.study.accuracy.study_file import StudyFile
from multiphi_exudyn.study.accuracy.study_findings import findings
from multiphi_exudyn.study.accuracy.study_report import render_study
from multiphi_exudyn.study.sweep.store import Store

QUESTION = "Can the spring explain it?"
WINDOWS = (0.25, 1.0, 2.0)
AXIS = "structure.clamp_rotation"
METHOD = "levels"


def shown(rates, seen):
    """Windows of given rates [Hz]; seen: open frequencies [Hz] in the first of them."""
    starts = (0.0, *WINDOWS[:-1])
    return [
        {"from": a, "until": b, "rate": rate, "closed": {"stop": 0.1}, "levels": {"open": seen if a == 0 else []}}
        for a, b, rate in zip(starts, WINDOWS, rates, strict=True)
    ]


def run_of(value, rates, method="reference", opened=(4.0, 40.0), closed=(12.0, 80.0), seen=()):
    natural = {"open": list(opened), "stop": list(closed)}
    return row(method, at={AXIS: value}, shown=shown(rates, list(seen)), natural=natural)


def study_of(rows, **asked):
    given = {"question": QUESTION, "point": "node3", "windows": WINDOWS} | {"ideal": "rigid"} | asked
    axes = {AXIS: tuple(dict.fromkeys(each.parameters["at"][AXIS] for each in rows))}
    methods = [{"name": METHOD, "model": {"kind": "reduced"}}]
    data = {"title": "t", "scene": "small", "methods": methods, "axes": axes, "frequencies": given}
    return result_of(rows, study=StudyFile.model_validate(data, strict=False))


RIGID = run_of("rigid", (6.0, 5.0, 4.0))
SOFT = run_of(100.0, (4.5, 4.2, 3.0), opened=(3.0, 30.0), closed=(9.0, 60.0), seen=(2.97, 31.0, 77.0))
COPY = run_of("rigid", (6.12, 5.1, 4.0), method="coarser")


class TestChanges:
    def test_rise_change_and_shift_are_the_ratios_they_say(self):
        found = {each.value: each for each in shown_of(study_of([SOFT, RIGID]))}
        assert [w.rise for w in found["rigid"].windows] == pytest.approx([0.5, 0.25, 0.0])
        assert [w.rise for w in found[100.0].windows] == pytest.approx([0.5, 0.4, 0.0])
        assert [w.change for w in found[100.0].windows] == pytest.approx([-0.25, -0.16, -0.25])
        assert found[100.0].shifts == pytest.approx(
            {("open", 1): -0.25, ("open", 2): -0.25, ("stop", 1): -0.25, ("stop", 2): -0.25}
        )

    def test_a_mean_weighs_windows_by_their_length_and_leaves_late_and_unknown_ones_out(self):
        (found,) = shown_of(study_of([RIGID]))
        assert found.mean("rate", 1.0) == pytest.approx(0.25 * 6 + 0.75 * 5)
        (gap,) = shown_of(study_of([run_of("rigid", (None, 5.0, 4.0))]))
        assert gap.mean("rise", 1.0) == pytest.approx(0.25)
        assert gap.mean("rise", 0.25) is None

    def test_a_seen_frequency_belongs_to_the_nearest_mode_and_is_counted_from_the_ideal_one(self):
        soft = shown_of(study_of([SOFT, RIGID]))[0]
        assert soft.windows[0].seen == pytest.approx({("open", 1): 2.97 / 4 - 1, ("open", 2): 31 / 40 - 1})
        assert soft.windows[1].seen == {}

    def test_changes_are_counted_from_a_method_at_the_same_value_where_the_study_says_so(self):
        rows = [SOFT, run_of(100.0, (4.0, 4.0, 3.0), METHOD), RIGID, run_of("rigid", (5.0, 5.0, 4.0), METHOD)]
        result = study_of(rows, ideal=None, ideal_method=METHOD)
        found = {(each.method, each.value): each.windows[0].change for each in shown_of(result)}
        assert found["reference", 100.0] == pytest.approx(0.125)
        assert found["reference", "rigid"] == pytest.approx(0.2)
        assert found[METHOD, "rigid"] == 0
        assert [each.value for each in ideal_of(result)] == [100.0, "rigid"]

    def test_uncertainty_is_the_coarser_copys_difference_in_the_early_rate(self):
        assert rate_uncertainty(study_of([RIGID, COPY])) == pytest.approx(0.02)
        assert rate_uncertainty(study_of([RIGID])) is None

    def test_a_study_that_does_not_ask_shows_nothing(self):
        result = result_of([SOFT])
        assert shown_of(result) == []
        assert frequency_figure(result) is None


class TestWords:
    @pytest.mark.parametrize(
        ("factor", "answer"),
        [(0.8, "No, by its sign"), (1.05, "No, by its size"), (1.2, "It can add to such a rise")],
    )
    def test_the_answer_follows_sign_and_size_beyond_the_references_uncertainty(self, factor, answer):
        changed_run = run_of(100.0, [factor * rate for rate in (6.0, 5.0, 4.0)])
        first = next(iter(frequency_outcome(study_of([changed_run, RIGID, COPY]))))
        assert first.startswith(f"{QUESTION} {answer}")
        assert signed(factor - 1) in first
        assert "that rate already is +31 % above the free frequency" in first

    def test_an_effect_of_both_signs_is_told_as_one(self):
        rows = [
            run_of(value, [factor * rate for rate in (6.0, 5.0, 4.0)]) for value, factor in ((1.0, 0.88), (2.0, 1.12))
        ]
        first = next(iter(frequency_outcome(study_of([*rows, RIGID]))))
        assert first.startswith(f"{QUESTION} That depends on its value: it changes")
        assert "-12 % to +12 %" in first

    def test_no_rise_is_laid_to_a_contact_that_makes_none(self):
        calm = run_of("rigid", (4.0, 4.0, 4.0))
        first = next(iter(frequency_outcome(study_of([SOFT, calm]))))
        assert "contact" not in first

    def test_levels_limit_and_sight_are_told_with_their_numbers(self):
        told = " ".join(frequency_outcome(study_of([SOFT, RIGID])))
        assert "open level, modes 1 to 2: at 100 -25 %, -25 %." in told
        assert "make it +50 %." in told  # 2 * 4 * 12 / 16 = 6 Hz
        assert "open level are seen in 1 of 6 windows, furthest from the ideal ones: mode 1 by -26 %" in told
        assert "no natural frequency of the level with stop closed is seen" in told
        assert "the same at all values" in " ".join(frequency_outcome(study_of([RIGID])))

    def test_nothing_is_told_of_a_failed_reference(self):
        failed = row("reference", at={AXIS: 100.0}, status="failed", message="no")
        assert list(frequency_outcome(study_of([failed]))) == []
        assert frequency_asked(study_of([failed])).startswith(QUESTION)


class TestFigure:
    def test_draws_levels_rise_change_and_course(self):
        levels, rise, change, course = frequency_figure(study_of([SOFT, RIGID, COPY])).axes
        assert sorted(line.get_ydata()[0] for line in levels.lines) == pytest.approx(4 * [-25.0])
        assert {text.get_text() for text in levels.texts} == {"free 1", "free 2", "stop 1", "stop 2"}
        np.testing.assert_allclose(rise.lines[0].get_ydata(), [42.5, 31.25])
        np.testing.assert_allclose(change.lines[0].get_ydata()[0], -18.25)
        heights = [patch.get_data().values for patch in course.patches]
        np.testing.assert_allclose(heights, [[50, 40, 0], [50, 25, 0]], atol=1e-9)
        assert [tick.get_text() for tick in rise.get_xticklabels()] == ["100", "rigid"]

    def test_leaves_the_levels_out_where_they_do_not_move(self):
        assert len(frequency_figure(study_of([RIGID])).axes) == 3

    def test_a_window_without_a_rate_is_a_gap(self):
        course = frequency_figure(study_of([run_of("rigid", (None, 5.0, 4.0))])).axes[-1]
        assert np.isnan(course.patches[0].get_data().values[0])


STUDY = {
    "title": "a small study",
    "scene": "small.toml",
    "timing": False,
    "axes": {"structure.beam.clamp.rotation": [60.0, 600.0]},
    "frequencies": {"question": QUESTION, "point": "tip", "windows": [0.2, 0.4], "ideal": 600.0},
    "methods": [{"name": METHOD, "model": {"kind": "reduced"}, "axes": {"modes": [4]}}],
}


@pytest.fixture
def study_file(tmp_path):
    outputs = {"t_end": 0.7, "interval": 1e-3, "points": ["tip"]}
    write(tmp_path / "small.toml", BEAM | {"outputs": outputs})
    return lambda data: write(tmp_path / "study.toml", data)


def test_a_study_runs_from_its_file_to_its_page(study_file, tmp_path):
    with Store(tmp_path / "runs.sqlite") as store:
        result = run_study(load_study(study_file(STUDY)), store, progress=False)
    soft, stiff = (each for each in shown_of(result) if each.method == "reference")
    assert soft.shifts["open", 1] < -0.05
    assert all(w.rise > 0.05 for each in (soft, stiff) for w in each.windows)
    assert findings(result).outcome[0].startswith(QUESTION)
    text = re.sub(r"<[^>]+>", " ", render_study(result))
    assert "Frequencies that the response shows" in text
    assert f"{soft.windows[1].rate:.3f} Hz, {signed(soft.windows[1].rise)}" in text


@pytest.mark.parametrize(
    ("path", "value", "line"),
    [
        (["frequencies", "ideal"], 7.0, "frequencies.ideal: got 7.0"),
        (["frequencies", "ideal_method"], "other", "frequencies.ideal_method: got 'other'"),
        (["frequencies", "windows"], [0.3, 0.15], "frequencies.windows: got [0.3, 0.15]"),
        (["frequencies", "point"], "nowhere", "frequencies.point: got 'nowhere'"),
        (["axes"], {}, "frequencies: got '0 axes'"),
        (["methods", 0, "axes"], {"modes": [4, 6]}, "frequencies: got 'a method with several settings'"),
    ],
)
def test_what_a_study_cannot_ask_is_refused_in_one_line(study_file, refused, path, value, line):
    file = study_file(changed(path, value, STUDY))
    refused(ValueError, f"{file}: {line}", load_study, file)
