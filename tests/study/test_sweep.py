"""Sweeps that lose nothing: killed, shared, interrupted, with cases that fail; where they run, and for how long."""

import contextlib
import json
import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from sweep_functions import (
    Unloadable,
    adds,
    busy,
    converts,
    dies,
    exudyn_steps,
    logged,
    many,
    odd_fails,
    square,
    swallows_once,
    sweep_logged,
    tells_no_raise,
    wave,
)
from threadpoolctl import threadpool_info

from multiphi_exudyn.study.sweep import Outcome, Row, Store, TimeLimitExceeded, call_within, grid, open_executor, sweep

ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
LONG = 60.0  # s, never waited for
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


@contextlib.contextmanager
def sweeping(path, cases):
    """A program that sweeps two held cases, with the processes it starts in a group of its own."""
    program = (
        "import sys, json, signal, sweep_functions\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a shell's background has it ignored
        "sweep_functions.sweep_held(*json.loads(sys.argv[1]))"
    )
    command = [sys.executable, "-c", program, json.dumps([str(path), cases])]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, env=ENVIRONMENT, start_new_session=True, **pipes) as parent:
        try:
            assert [parent.stdout.readline() for _ in range(2)] == ["runs\n"] * 2
            yield parent
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(parent.pid, signal.SIGKILL)


def test_a_call_within_its_time_gives_what_it_gives():
    assert call_within(None, lambda: 3) == 3
    assert call_within(LONG, lambda: 3) == 3
    with pytest.raises(ZeroDivisionError):
        call_within(LONG, lambda: 1 / 0)


@pytest.mark.parametrize("call", [time.sleep, lambda seconds: busy({"seconds": seconds})])
def test_a_call_beyond_its_time_is_stopped(call):
    begun = time.perf_counter()
    with pytest.raises(TimeLimitExceeded):
        call_within(0.05, lambda: call(LONG))
    assert 0.05 <= time.perf_counter() - begun < LONG / 2


def test_nothing_arrives_after_a_call_that_ends_when_its_time_does():
    def stopped(limit):
        try:
            call_within(limit, lambda: busy({"seconds": 1e-3}))
        except TimeLimitExceeded:
            return True
        finally:
            busy({"seconds": 1e-4})  # what is left of the limit would be raised here
        return False

    assert {stopped(5e-4 + number * 4e-6) for number in range(250)} == {True, False}


def limited_rows(store, executor):
    cases = grid({"seconds": [0.0, LONG]})
    return [sweep(run, cases, store, run.__name__, executor=executor, budget_s=0.1) for run in (busy, converts)]


@pytest.mark.parametrize("where", ["here", "serial", "processes"])
def test_the_budget_holds_in_this_process_and_in_others(store, pool, where):
    with open_executor("serial") as serial:
        executor = {"here": None, "serial": serial, "processes": pool}[where]
        for short, long in limited_rows(store, executor):
            assert (short.status, short.values) == ("ok", {"seconds": 0.0})
            assert (long.status, long.values) == ("over budget", {})
            assert long.message.endswith("s, the budget is 0.1 s")
            assert 0.1 < long.elapsed_s < LONG / 2


def test_a_solver_with_a_user_function_is_stopped(store):
    (row,) = sweep(exudyn_steps, [{"steps": 10**9}], store, "exudyn", budget_s=0.2)
    assert (row.status, row.values) == ("over budget", {})
    (row,) = sweep(exudyn_steps, [{"steps": 10}], store, "exudyn", budget_s=LONG)
    assert (row.status, row.values) == ("ok", {"position": pytest.approx(0.5)})


def test_what_a_run_makes_of_the_exception_does_not_matter(store):
    for run in (tells_no_raise, swallows_once):
        (row,) = sweep(run, [{"seconds": LONG}], store, run.__name__, budget_s=0.05)
        assert row.status == "over budget"


def test_a_run_that_cannot_be_stopped_is_over_budget_when_it_ends(store):
    with ThreadPoolExecutor(1) as threads:
        (row,) = sweep(busy, [{"seconds": 0.1}], store, "busy", budget_s=0.05, executor=threads)
    assert row.status == "over budget"
    assert row.elapsed_s >= 0.1


def test_a_process_that_stays_in_compiled_code_is_killed(store, monkeypatch):
    monkeypatch.setattr("multiphi_exudyn.study.sweep.GRACE_S", 0.5)
    with open_executor("processes", 1) as executor:
        rows = sweep(adds, grid({"numbers": [10**11, 10]}), store, "adds", executor=executor, budget_s=0.5)
    assert [row.status for row in rows] == ["over budget", "ok"]
    assert 1.0 <= rows[0].elapsed_s < 30.0


def test_a_budget_that_is_no_time_is_refused(store, refused):
    for budget in (0, -1.0, float("nan"), float("inf")):
        refused(ValueError, f"budget_s: {budget}", sweep, square, [], store, "pass", budget_s=budget)


def test_a_worker_has_one_blas_thread_and_leaves_ctrl_c_to_its_parent(monkeypatch):
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        monkeypatch.setenv(name, "2")
    with open_executor("processes", 1) as executor:
        assert {found["num_threads"] for found in executor.submit(threadpool_info).result()} == {1}
        assert executor.submit(os.getenv, "OPENBLAS_NUM_THREADS").result() == "1"
        assert executor.submit(signal.getsignal, signal.SIGINT).result() == signal.SIG_IGN


def test_only_the_case_that_kills_its_worker_fails(store):
    cases = grid({"fatal": [[3, 4]], "x": range(8)})
    with open_executor("processes", 2) as executor:
        rows = sweep(dies, cases, store, "dies", executor=executor)
        again = sweep(dies, cases, store, "dies", executor=executor)
    assert [row.parameters["x"] for row in rows if row.status == "failed"] == [3, 4]
    assert {row.message for row in rows if row.status == "failed"} == {"worker process died"}
    assert [row.values["x"] for row in rows if row.status == "ok"] == [0, 1, 2, 5, 6, 7]
    assert again == rows


def test_workers_that_cannot_start_end_the_sweep_and_no_case_fails(tmp_path):
    """A script that opens them without a guard starts itself again in each."""
    script = tmp_path / "unguarded.py"
    script.write_text(
        "from multiphi_exudyn.study.sweep import Store, open_executor, sweep\n"
        "def run(case): return {}\n"
        "with Store('runs.db') as store, open_executor('processes', 1) as executor:\n"
        "    sweep(run, [{'x': 1}], store, 'pass', executor=executor)\n"
    )
    command = [sys.executable, str(script)]
    told = subprocess.run(command, capture_output=True, text=True, env=ENVIRONMENT, cwd=tmp_path, timeout=LONG)
    assert "a script needs `if __name__ == '__main__':`" in told.stderr.splitlines()[-1]
    with Store(tmp_path / "runs.db") as store:
        assert store.rows("pass") == ()


@pytest.mark.parametrize("locked", [False, True])
def test_workers_end_with_a_parent_that_is_killed(tmp_path, locked):
    if locked and sys.platform != "linux":
        pytest.skip("a worker inside compiled code is told by a signal that Linux has")
    with sweeping(tmp_path / "runs.db", grid({"locked": [locked], "x": range(4)})) as parent:
        parent.kill()
        output, _ = parent.communicate(timeout=LONG)  # to the end of the pipe: nobody holds it any more
    assert output == ""


def test_ctrl_c_keeps_what_has_finished_and_ends_the_workers(tmp_path):
    with sweeping(tmp_path / "runs.db", grid({"locked": [True], "short": [10], "x": range(14)})) as parent:
        time.sleep(0.5)  # the last of the short ones may still be on its way to the parent
        os.killpg(parent.pid, signal.SIGINT)
        _, errors = parent.communicate(timeout=LONG)
    assert parent.returncode != 0
    assert errors.count("KeyboardInterrupt") == 1
    with Store(tmp_path / "runs.db") as store:
        assert sorted(row.parameters["x"] for row in store.rows("held")) == list(range(10))


@pytest.mark.parametrize(("where", "workers"), [("dask", None), ("tcp://host", None), ("", None), ("processes", 0)])
def test_a_place_that_is_none_is_refused(refused, where, workers):
    refused(ValueError, "workers: 0" if workers == 0 else f"where: {where!r}", open_executor, where, workers)


def test_a_missing_cluster_package_is_named(refused, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    refused(
        ValueError, "where: tcp://127.0.0.1:8786; need the package", open_executor("tcp://127.0.0.1:8786").__enter__
    )


def test_an_address_without_an_answer_is_named(refused, monkeypatch):
    monkeypatch.setattr("multiphi_exudyn.study.sweep.ANSWER_S", 0.5)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{taken.getsockname()[1]}"
        refused(ValueError, f"where: no answer at {address}", open_executor(address).__enter__)


@pytest.fixture
def cluster(tmp_path):
    """Address of a Dask scheduler with two workers, in processes of their own."""
    file = tmp_path / "scheduler.json"
    environment = ENVIRONMENT | {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}

    with contextlib.ExitStack() as programs:

        def start(program, *options):
            command = [sys.executable, "-m", f"distributed.cli.{program}", "--no-dashboard", "--host", "127.0.0.1"]
            opened = subprocess.Popen([*command, *options], stderr=subprocess.DEVNULL, env=environment, cwd=tmp_path)
            programs.enter_context(opened)
            programs.callback(opened.kill)

        start("dask_scheduler", "--port", "0", "--scheduler-file", str(file))
        for _ in range(2):
            start("dask_worker", "--scheduler-file", str(file), "--nthreads", "1", "--no-nanny")
        yield address_in(file)


def address_in(file):
    """The address that a scheduler writes; its file is there before its text is."""
    until = time.perf_counter() + LONG
    while time.perf_counter() < until:
        with contextlib.suppress(FileNotFoundError, json.JSONDecodeError):
            return json.loads(file.read_text())["address"]
        time.sleep(0.01)
    raise TimeoutError(f"no scheduler within {LONG} s")


def told(rows):
    return [(row.parameters, row.status, row.values) for row in rows]


def test_a_cluster_gives_the_rows_of_this_process(store, cluster):
    cases = grid({"x": range(40)})
    with open_executor(cluster) as executor:
        rows = sweep(square, cases, store, "cluster", executor=executor)
        (late,) = sweep(busy, [{"seconds": 0.1}], store, "late", executor=executor, budget_s=0.05)
        (died,) = sweep(dies, [{"x": 1, "fatal": [1]}], store, "dies", executor=executor)
    assert told(rows) == told(sweep(square, cases, store, "here"))
    assert late.status == "over budget"
    assert (died.status, died.message) == ("failed", "worker process died")
