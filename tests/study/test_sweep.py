"""Sweeps that lose nothing: killed, shared, interrupted, with cases that fail."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from sweep_functions import Unloadable, logged, many, odd_fails, square, sweep_logged, wave

from multiphi_exudyn.study.sweep import Outcome, Row, Store, grid, open_executor, sweep

ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
FEW, MANY = [0, 0, 1, 4, 6], [0] * 14 + [1, 1, 2, 2, 3, 3]  # after how many more cases; each costs the start of a pool


@pytest.fixture
def store(tmp_path):
    with Store(tmp_path / "runs.db") as opened:
        yield opened


@pytest.fixture(scope="module")
def pool():
    with open_executor("processes", 2) as executor:
        yield executor


def program(code, *arguments, **options):
    command = [sys.executable, "-c", f"import sys, json, sweep_functions as f; {code}", json.dumps(arguments)]
    return subprocess.Popen(command, text=True, env=ENVIRONMENT, **options)


def test_a_grid_is_the_product_with_the_last_axis_fastest():
    cases = grid({"a": [1, 2], "b": np.array([0.5, 1.5]), "c": ("x",)})
    assert [tuple(case.values()) for case in cases] == [(1, 0.5, "x"), (1, 1.5, "x"), (2, 0.5, "x"), (2, 1.5, "x")]
    assert grid({"a": [1], "b": []}) == []
    assert grid({}) == [{}]


@pytest.mark.parametrize("values", ["text", 3, {"x": 1}])
def test_an_axis_that_is_no_sequence_is_refused(refused, values):
    refused(TypeError, "axes: 'a' is ", grid, {"a": values})


def test_rows_are_those_of_the_cases_in_their_order(store, pool):
    cases = grid({"x": [3, 1, 2, 1]})
    sweep(square, grid({"x": [7, 2]}), store, "pass")
    rows = sweep(square, cases, store, "pass", executor=pool)
    assert [row.parameters for row in rows] == cases
    assert [row.values["square"] for row in rows] == [9, 1, 4, 1]
    assert {row.parameters["x"] for row in store.rows("pass")} == {7, 3, 1, 2}
    assert len(store.rows("pass")) == 4


def test_a_row_tells_what_how_long_where_and_when(store):
    (row,) = sweep(square, [{"x": 4}], store, "pass")
    assert (row.status, row.message) == ("ok", "")
    assert row.values == {"square": 16, "root": 2.0, "list": [4, None, "text"]}
    assert 0 < row.elapsed_s < 10
    assert row.environment["versions"]["numpy"] == np.__version__
    assert row.finished.endswith("+00:00")


def test_a_finished_case_is_not_run_again_whatever_its_status(store):
    cases = grid({"x": range(4)})
    rows = sweep(odd_fails, cases, store, "pass")
    assert [row.status for row in rows] == ["ok", "failed", "failed", "failed"]
    assert [row.message for row in rows[1:]] == [
        "ValueError: 1 is odd",
        "two is told, not raised",
        "ValueError: 3 is odd",
    ]
    assert rows[2].values == {"x": 2}
    assert sweep(lambda case: pytest.fail("is run again"), cases, store, "pass") == rows


class Unprintable(Exception):
    def __str__(self):
        raise RuntimeError


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (SystemExit(1), "SystemExit: 1"),
        (Unprintable(), "Unprintable: its message cannot be written"),
        (OSError("\ud800 a\tb"), "OSError: ? a b"),
        (AssertionError(), "AssertionError"),
    ],
)
def test_any_error_of_a_run_is_a_cause_in_one_line(store, error, message):
    def fails(case):
        raise error

    (row,) = sweep(fails, [{}], store, "pass")
    assert (row.status, row.message) == ("failed", message)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ([1], "MultiPhiTypeError: function: it gave list"),
        ({"y": np.zeros(2)}, "MultiPhiValueError: values['y']: ndarray"),
        (Outcome({}, {"y": np.array([{}])}), "histories: ValueError: Object arrays"),
    ],
)
def test_a_run_that_gives_what_no_row_can_hold_has_failed(store, given, message):
    (row,) = sweep(lambda case: given, [{}], store, "pass", keep_histories=True)
    assert row.status == "failed"
    assert row.message.startswith(message)


def test_an_outcome_has_a_known_status(refused):
    refused(ValueError, "status: 'good'", Outcome, {}, {}, "good")


@pytest.mark.parametrize("where", ["here", "processes"])
def test_histories_are_kept_where_they_are_asked_for(store, pool, where):
    executor = pool if where == "processes" else None
    sweep(wave, [{"x": 3}], store, "with", executor=executor, keep_histories=True)
    sweep(wave, [{"x": 3}], store, "without", executor=executor)
    found = store.histories("with", {"x": 3})
    assert found.keys() == {"time", "file"}
    assert np.array_equal(found["file"], np.sin(3 * np.linspace(0.0, 1.0, 50)))
    assert store.histories("without", {"x": 3}) is None


def test_a_run_cannot_change_its_parameters(store):
    def changes(case):
        case["x"].append(case.pop("y"))
        return {}

    (row,) = sweep(changes, [{"x": [1], "y": 2}], store, "pass")
    assert (row.status, row.parameters) == ("ok", {"x": [1], "y": 2})


def test_cases_that_json_does_not_have_are_refused_before_the_first_run(store, refused):
    cases = [{"x": 1}, {"x": float("nan")}]
    refused(ValueError, "cases[1]['x']: nan", sweep, square, cases, store, "pass")
    refused(TypeError, "cases[0]: int", sweep, square, [1], store, "pass")
    assert store.rows("pass") == ()


def test_a_function_that_no_worker_can_have_ends_the_sweep_and_no_case_fails(store, pool, refused):
    refused(ValueError, "function: ", sweep, lambda case: {}, [{}], store, "pass", executor=pool)
    refused(ValueError, "function: ImportError", sweep, Unloadable(), [{}], store, "pass", executor=pool)
    assert store.rows("pass") == ()


def test_a_case_that_another_has_finished_meanwhile_is_not_started(store):
    run = []

    def meddles(case):
        run.append(case["x"])
        with Store(store.path) as other:
            given = {"x": case["x"] + 2}
            other.add("pass", given, Row(given, "ok", "", {"by": "another"}, 0.0, {}, ""))
        return {"by": "this one"}

    rows = sweep(meddles, grid({"x": range(6)}), store, "pass")
    assert run == [0, 1, 4, 5]
    assert [row.values["by"] for row in rows] == ["this one"] * 2 + ["another"] * 2 + ["this one"] * 2


class Counting(ThreadPoolExecutor):
    """Counts the calls that have not ended."""

    workers = 2
    flying = most = 0

    def submit(self, *given):
        self.flying += 1
        self.most = max(self.most, self.flying)
        future = super().submit(*given)
        future.add_done_callback(self.landed)
        return future

    def landed(self, future):
        self.flying -= 1


def test_only_a_few_cases_are_in_flight(store):
    with Counting(2) as executor:
        assert len(sweep(square, grid({"x": range(50)}), store, "pass", executor=executor)) == 50
    assert 1 <= executor.most <= 4


def test_ctrl_c_in_this_process_keeps_what_has_finished(store):
    def interrupted(case):
        if case["x"] == 3:
            raise KeyboardInterrupt
        return {}

    with pytest.raises(KeyboardInterrupt):
        sweep(interrupted, grid({"x": range(6)}), store, "pass")
    assert [row.parameters["x"] for row in store.rows("pass")] == [0, 1, 2]


class Interrupted(Store):
    """Ctrl-C comes when the third run has ended and is not yet stored."""

    given = 0

    def add(self, *given):
        self.given += 1
        if self.given == 3:
            raise KeyboardInterrupt
        return super().add(*given)


def test_what_has_finished_and_is_not_yet_stored_outlives_ctrl_c(tmp_path):
    with Interrupted(tmp_path / "runs.db") as store:
        with pytest.raises(KeyboardInterrupt):
            sweep(square, grid({"x": range(6)}), store, "pass")
        assert [row.parameters["x"] for row in store.rows("pass")] == [0, 1, 2]


def lines(log):
    return log.read_text().splitlines() if log.exists() else []


def finished(path):
    if not path.exists():
        return set()
    with Store(path) as store:
        return {str(row.parameters["x"]) for row in store.rows("kill")}


def kill_at_a_random_moment(child, more, chance, log):
    """SIGKILL while the sweep starts, or a little after some more cases have begun."""
    known, until = len(lines(log)), time.perf_counter() + 20.0
    while len(lines(log)) < known + more and time.perf_counter() < until:
        time.sleep(0.001)
    time.sleep(chance.uniform(0.0, 0.015 if more else 0.03))
    os.kill(child, signal.SIGKILL)


@pytest.mark.parametrize("kills", [pytest.param(FEW, id="5"), pytest.param(MANY, id="20", marks=pytest.mark.slow)])
def test_a_killed_sweep_goes_on_where_it_was(tmp_path, kills):
    path, log, chance = tmp_path / "runs.db", tmp_path / "log", random.Random(1)
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with program("f.nursery(*json.loads(sys.argv[1]))", str(path), str(log), **pipes) as nursery:
        for more in chance.sample(kills, len(kills)):
            before, known = len(lines(log)), finished(path)
            print(chance.choice([1, 1, 2]), file=nursery.stdin, flush=True)
            kill_at_a_random_moment(int(nursery.stdout.readline()), more, chance, log)
            assert nursery.stdout.readline() == "-1\n"
            assert not known & set(lines(log)[before:]), "a finished case has been run again"
            assert known <= finished(path), "a finished case has been lost"
    assert 0 < len(finished(path)) < 60
    sweep_logged(path, log, 2)
    with Store(path) as store:
        rows = store.rows("kill")
        whole = sweep(logged, many(log), store, "never killed")
    assert Counter(row.parameters["x"] for row in rows) == Counter(range(60))
    assert {row.parameters["x"]: row.values for row in rows} == {row.parameters["x"]: row.values for row in whole}


def test_two_processes_sweep_into_one_file(tmp_path):
    path, log = tmp_path / "runs.db", tmp_path / "log"
    both = [program("f.sweep_here(*json.loads(sys.argv[1]))", str(path), str(log), reverse) for reverse in (0, 1)]
    assert [process.wait(timeout=60) for process in both] == [0, 0]
    with Store(path) as store:
        rows = store.rows("shared")
    assert Counter(row.parameters["x"] for row in rows) == Counter(range(60))
    assert all(row.values == {"square": row.parameters["x"] ** 2} for row in rows)
    assert len(lines(log)) < 120
