"""Fronts, gaps, orders, correlation and tables on data whose answers are known."""

import csv
import io
import math
from dataclasses import replace

import pandas as pd
import pytest
from small_study import in_turns, result_of, row, small_study, timing

from multiphi_exudyn.study.accuracy import (
    cheapest,
    csv_text,
    front,
    full_methods,
    near_cheapest,
    numeric_axes,
    points,
    pointwise_until,
    references_at,
    series,
    settings,
    settings_at_worst,
    tables_along,
    uncertainty,
    words,
)
from multiphi_exudyn.study.study_file import MethodSpec

STEP = {"step": 1e-4}
REFINED = MethodSpec(name="m", model={"kind": "reduced"}, refine="modes")


def timed(**pairs):
    """A study of methods whose settings 1, 2, ... have given (time, error)."""
    runs = [(name, {"modes": i}, *pair) for name, given in pairs.items() for i, pair in enumerate(given, start=1)]
    rows = [row(name, error, setting=setting) for name, setting, _, error in runs]
    timings = [timing(name, online, setting=setting) for name, setting, online, _ in runs if online is not None]
    methods = [{"name": name, "model": {"kind": "full" if "full" in name else "reduced"}} for name in pairs]
    return result_of(rows, timings, methods)


def lines(table):
    return list(table.itertuples())


def modes_of(table):
    return [setting["modes"] for setting in table.setting]


def chosen(found):
    """Method -> number of modes of its setting, None where it has none."""
    return {s.method: None if pd.isna(s.online_s) else s.setting["modes"] for s in lines(found)}


def test_a_setting_is_as_wrong_as_the_worst_of_its_nearby_runs_and_of_the_judged_points():
    rows = [
        row("a", e, setting=STEP, nearby=near) for e, near in ((0.01, {}), (0.05, {"step": 0.9}), (0.02, {"step": 0.8}))
    ]
    (found,) = lines(settings(result_of(rows, [timing("a", 2.0, setting=STEP)])))
    assert (found.error, found.own_error, found.message) == (0.05, 0.01, "")
    assert (found.online_s, found.repeats_s, found.first_s, found.offline_s) == (2.0, [2.0, 1.8, 2.6], 4.0, 0.3)
    (only_node2,) = lines(settings(result_of(rows, judged_points=("node2",))))
    assert only_node2.error == 0.025


@pytest.mark.parametrize("status", ["failed", "over budget"])
def test_one_nearby_run_without_an_error_leaves_a_gap_with_its_cause(status):
    rows = [row("a", 0.01, setting=STEP), row("a", setting=STEP, nearby={"step": 0.9}, status=status, message="why")]
    result = result_of(rows, [timing("a", 2.0, setting=STEP)])
    (found,) = lines(settings(result))
    assert math.isnan(found.error)
    assert found.own_error == 0.01
    assert found.message == f"{status}: why (nearby: step × 0.9)"
    assert front(settings(result)).empty
    assert chosen(cheapest(result, {}, 1.0)) == {"a": None}


def test_no_error_is_told_apart_from_no_run_and_the_reference_needs_none():
    rows = [row("reference"), row("a"), row("b", 0.1)]
    broken = replace(timing("b", 1.0), status="failed", message="machine asleep", values={})
    result = result_of(rows, [broken])
    assert list(settings(result).message) == ["no error: nothing to compare it with", "timing failed: machine asleep"]
    assert list(references_at(result, {}).message) == [""]
    half = result_of([replace(row("a"), values={"nrmse": {"0.3": {"node2": 0.1, "node3": None}}})])
    assert list(settings(half).error.isna()) == [True]


def test_settings_at_other_points_of_the_scene_are_others():
    rows = [row(m, e, {"load": x}) for x, e in ((1.0, 0.1), (2.0, 0.2)) for m in ("coarser", "a")]
    result = result_of(rows, [timing("a", x, {"load": x}) for x in (1.0, 2.0)])
    assert [(s.at["load"], s.error, s.online_s) for s in lines(settings(result))] == [(1.0, 0.1, 1.0), (2.0, 0.2, 2.0)]
    assert points(result) == [{"load": 1.0}, {"load": 2.0}]
    assert uncertainty(result, {"load": 2.0}) == 0.2
    assert uncertainty(result, {"load": 3.0}) is None


def test_over_several_points_a_setting_is_as_wrong_as_at_its_worst_one():
    """Setting 1 is the best of all at load 1, setting 3 has no error at load 2."""
    errors = {(1, 1.0): 0.01, (1, 2.0): 0.4, (2, 1.0): 0.06, (2, 2.0): 0.02, (3, 1.0): 0.001, (3, 2.0): None}
    rows = [row("a", e, {"load": x}, {"modes": m}) for (m, x), e in errors.items()]
    timings = [timing("a", m * x, {"load": x}, {"modes": m}) for m, x in errors]
    result = result_of(rows, timings, [{"name": "a", "model": {"kind": "reduced"}}])
    found = lines(settings_at_worst(result))
    assert [s.setting["modes"] for s in found] == [1, 2, 3]
    assert [(s.at["load"], s.online_s) for s in found] == [(2.0, 1.5), (1.0, 3.0), (2.0, 4.5)]
    assert [s.error for s in found][:2] == [0.4, 0.06]
    assert math.isnan(found[2].error)
    for tolerance, modes in ((0.5, 1), (0.1, 2), (0.05, None)):
        assert chosen(cheapest(result, None, tolerance)) == {"a": modes}


@pytest.mark.parametrize(
    ("pairs", "expected"),
    [
        ([(1, 0.5), (2, 0.2), (3, 0.3), (4, 0.1)], [1, 2, 4]),
        ([(4, 0.1), (3, 0.3), (2, 0.2), (1, 0.5)], [4, 3, 1]),
        ([(1, 0.5), (1, 0.4), (2, 0.4)], [2]),  # equal times, equal errors
        ([(1, 0.5), (1, 0.5)], [1]),  # the same twice
        ([(1, None), (None, 0.1), (3, 0.3)], [3]),  # a gap, and one without a time
        ([(1, 0.0), (2, 0.0)], [1]),
        ([], []),
    ],
)
def test_the_front_holds_what_nothing_beats_in_time_and_error(pairs, expected):
    assert modes_of(front(timed(a=pairs).table)) == expected


def test_the_cheapest_setting_is_the_fastest_that_holds_the_tolerance():
    both = timed(a=[(1, 0.5), (2, 0.02), (3, 0.01), (4, 0.001)], b=[(9, 0.3)])
    assert chosen(cheapest(both, {}, 0.02)) == {"a": 2, "b": None}
    assert chosen(cheapest(both, {}, 0.0199)) == {"a": 3, "b": None}
    assert chosen(cheapest(both, {}, 1e-6)) == {"a": None, "b": None}


def test_near_the_cheapest_are_settings_whose_order_a_change_of_speed_could_turn():
    both = timed(a=[(1.0, 0.5), (1e-3, 0.02), (1e-2, 0.02), (1.1e-2, 0.02)], b=[(0.1, 0.01), (0.9, 0.001), (1.1, 0.01)])
    found = near_cheapest(both, {})
    assert list(zip(found.method, modes_of(found), strict=True)) == [("a", 2), ("a", 3), ("b", 1), ("b", 2)]
    assert near_cheapest(timed(a=[(2.0, 0.01), (2.1, 0.01)]), {}).empty  # too long to be repeated
    assert near_cheapest(timed(a=[(None, 0.01), (1e-3, None)]), {}).empty


def test_of_settings_timed_in_turns_too_these_times_count():
    result = timed(a=[(1.0, 0.01)], b=[(1.1, 0.01), (5.0, 0.001)])
    assert chosen(cheapest(result, {}, 0.01).head(1)) == {"a": 1}
    several = [2.0, 1.2, 1.2, 2.0, 1.0, 1.2, 2.0, 2.0]
    turns = in_turns([("a", {"modes": 1}, several), ("b", {"modes": 1}, [1.1] * 8)])
    turned = replace(result, turns=(turns,))
    found = settings(turned)
    assert list(found.online_s) == [1.2, 1.1, 5.0]
    assert list(found.repeats_s) == [several, [1.1] * 8, settings(result).repeats_s.iloc[2]]
    assert list(found.in_turns) == [True, True, False]
    assert chosen(cheapest(turned, {}, 0.01).head(1)) == {"b": 1}
    read = list(csv.DictReader(io.StringIO(csv_text(turned))))
    assert [(line["timing.online_s"], line["turns.online_s"]) for line in read] == [
        ("1.0", "1.2"),
        ("1.1", "1.1"),
        ("5.0", ""),
    ]
    few = in_turns([("a", {"modes": 1}, [9.0] * 7)])
    for none in (few, replace(few, status="failed", values={})):
        assert settings(replace(result, turns=(none,))).equals(settings(result))


def test_a_setting_that_is_given_twice_has_its_times_twice():
    rows = [row("a", 0.01, setting=STEP), row("a", 0.01, setting=STEP), row("b", 0.01)]
    timings = [timing("a", 2.0, setting=STEP), timing("a", 2.2, setting=STEP), timing("b", 3.0)]
    turns = (in_turns([("a", STEP, [1.5] * 8), ("b", {}, [2.5] * 8)]),)
    assert list(settings(result_of(rows, timings, turns=turns)).online_s) == [1.5, 1.5, 2.5]


def test_how_many_times_faster_counts_from_the_fastest_full_model_of_the_same_tolerance():
    given = {"full": [(10, 0.1)], "a": [(2, 0.1)], "other full": [(8, 0.1), (5, 0.3)], "none": [(1, 0.9)]}
    found = cheapest(timed(**given), {}, 0.1)
    assert list(found.method) == ["a", "other full", "full", "none"]  # the fastest first
    assert list(found.faster) == pytest.approx([4, 1, 0.8, math.nan], nan_ok=True)
    assert cheapest(timed(a=[(2, 0.1)], full=[(1, 0.9)]), {}, 0.1).faster.isna().all()
    assert full_methods(small_study()) == ["full ANCF"]


@pytest.mark.parametrize(
    ("axis", "values", "order"),
    [("step", (1e-5, 2e-5, 8e-5), 1), ("step", (1e-5, 3e-5), 2), ("modes", (2, 3, 8), 4), ("elements", (4, 8), 2)],
)
def test_observed_orders_are_those_of_the_power_law(axis, values, order):
    sign = 1 if axis == "step" else -1
    rows = [row("a", 1e-3 * (v / values[0]) ** (sign * order), setting={axis: v}) for v in reversed(values)]
    found = series(settings(result_of(rows)), "a", axis)
    assert list(found.table.value) == list(values)
    assert list(found.table.order[1:]) == pytest.approx([order] * (len(values) - 1))


def test_a_gap_or_a_zero_has_no_order():
    rows = [row("a", 0.1, setting={"modes": 1}), row("a", 0.0, setting={"modes": 2}), row("a", setting={"modes": 3})]
    assert series(settings(result_of(rows)), "a", "modes").table.order.isna().all()


def test_the_other_fields_stand_at_their_finest_that_has_errors():
    found = settings(small_study())
    assert series(found, "full ANCF", "step").fixed == {"elements": 16}
    assert series(found, "full ANCF", "elements").fixed == {"step": 2e-5}
    assert series(found, "Craig-Bampton", "step").fixed == {"modes": 8}
    gone = found.assign(error=found.error.where(found.setting.map(lambda each: each.get("elements") != 16)))
    assert series(gone, "full ANCF", "step").fixed == {"elements": 8}
    assert series(found, "Multi-Phi", "step") is None
    rows = [row("a", r, setting={"modes": m, "step": s}) for m, r in ((2, 1), ("all", 2)) for s in (1, 2)]
    assert series(settings(result_of(rows)), "a", "step").fixed == {"modes": "all"}


def test_along_the_scene_methods_and_the_reference_stand_side_by_side():
    result = small_study({"start.displacement": [-0.01, 0.02]})
    assert numeric_axes(settings(result), "at") == ["start.displacement"]
    assert numeric_axes(settings(result), "setting") == ["modes", "step", "elements"]
    tables = tables_along(result, "start.displacement")
    assert list(tables) == ["error", "first_contact.stop", "inner_losses.stop", "impulse.stop"]
    error = tables["error"]
    assert list(error.columns) == [-0.01, 0.02]
    assert "reference" not in error.index
    assert list(error.loc["coarser"]) == [0.001, 0.001]
    assert list(error.loc["Multi-Phi"]) == pytest.approx([1.4 * 1.2 * 16**-2.5, 1.8 * 1.2 * 16**-2.5])
    losses = tables["inner_losses.stop"]
    assert list(losses.loc["reference"]) == [0, 0]
    assert list(losses.loc["Multi-Phi, rigid"]) == [round(40 * (0.06 + 12**-2) * grown) for grown in (1.4, 1.8)]
    slope = series(settings(result), "Multi-Phi", "start.displacement").table.order
    assert list(slope.isna()) == [True, True]  # a value that changes its sign


def test_a_value_that_a_method_lacks_is_an_empty_cell():
    rows = [
        row("a", 0.1, {"load": 1.0}),
        row("a", 0.2, {"load": 2.0}),
        row("b", 0.3, {"load": 2.0}),
        row("b", 0.4, {"load": 3.0}),
    ]
    error = tables_along(result_of(rows), "load")["error"]
    assert error.loc["a"].tolist() == pytest.approx([0.1, 0.2, math.nan], nan_ok=True)
    assert error.loc["b"].tolist() == pytest.approx([math.nan, 0.3, 0.4], nan_ok=True)


def test_pointwise_comparison_ends_where_the_coarser_copy_leaves():
    assert pointwise_until(small_study(), {}, 0.01) == 0.25
    assert pointwise_until(small_study(), {}, 0.02) is None


def test_the_csv_gives_every_number_back():
    result = small_study({"start.displacement": [-0.01, 0.02]})
    read = list(csv.DictReader(io.StringIO(csv_text(result))))
    assert len(read) == len(result.rows)
    for line, given in zip(read, result.rows, strict=True):
        assert line["method"] == given.parameters["method"]
        assert float(line["at.start.displacement"]) == given.parameters["at"]["start.displacement"]
        assert (line["status"], line["cause"]) == (given.status, given.message)
        error = given.values.get("nrmse", {}).get("0.3", {}).get("node3")
        assert line["nrmse.0.3.node3"] == ("" if error is None else str(error))
    times = [float(line["timing.online_s"]) for line in read if line["timing.online_s"]]
    assert times == [row.values["online_s"] for row in result.timings]
    assert read[0]["finished"] == "2026-01-02T03:04:05Z"
    nearby = [line for line in read if line["nearby.step"]]
    assert len(nearby) == 2 * 2 * (12 + 12)
    assert all(line["timing.online_s"] == "" for line in nearby)


def test_settings_are_said_in_words():
    assert words({"modes": 8, "step": 7e-5, "elements": 20}) == "r = 8, step 70 µs, 20 elements"
    assert words({"rtol": 1e-6, "contact": "rigid", "start.displacement": 0.02}) == (
        "rtol = 1e-06, contact = rigid, start.displacement = 0.02"
    )
    assert words({}) == ""


def test_a_setting_lasts_where_every_finer_one_holds_too():
    """Errors of mesh and step cancel at steps 4 and 2; the mesh error shows at step 1."""
    errors = {(6, 8): 0.05, (6, 4): 0.004, (6, 2): 0.006, (6, 1): 0.02, (9, 2): 0.008, (9, 1): None}
    rows = [row("full", error, setting={"elements": n, "step": h}) for (n, h), error in errors.items()]
    method = {"name": "full", "model": {"kind": "full"}}
    found = settings(result_of(rows, methods=[method | {"refine": "step"}]))
    assert list(found.lasting_error) == pytest.approx([0.05, 0.02, 0.02, 0.02, math.nan, math.nan], nan_ok=True)
    plain = settings(result_of(rows, methods=[method]))
    assert plain.lasting_error.equals(plain.error)


def test_few_modes_that_are_right_by_chance_do_not_last():
    """Error 0.9 % with 4 modes, 6 % with 6 and 0.4 % with 8."""
    rows = [row("few", error, setting={"modes": r}) for r, error in ((4, 0.009), (6, 0.06), (8, 0.004))]
    method = {"name": "few", "model": {"kind": "reduced"}, "refine": "modes"}
    assert list(settings(result_of(rows, methods=[method])).lasting_error) == [0.06, 0.06, 0.004]


def test_the_cheapest_lasting_setting_is_another_one():
    given = timed(m=[(1, 0.01), (2, 0.05), (3, 0.015)])  # right by chance with one mode
    given = replace(given, study=given.study.model_copy(update={"methods": [REFINED]}))
    assert chosen(cheapest(given, {}, 0.02)) == {"m": 1}
    assert chosen(cheapest(given, {}, 0.02, lasting=True)) == {"m": 3}
