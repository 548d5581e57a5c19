"""Where runs are computed, how they are stopped when their time is over, and what ends with its parent."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import pytest
from sweep_functions import busy, converts, dies, exudyn_steps, square, swallows_once, tells_no_raise
from threadpoolctl import threadpool_info

from multiphi_exudyn.errors import MultiPhiError
from multiphi_exudyn.study.sweep import Store, grid, open_executor, sweep
from multiphi_exudyn.study.sweep.executors import WorkerPool
from multiphi_exudyn.study.sweep.time_limit import TimeLimitExceeded, call_within

ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
LONG = 60.0  # s, never waited for


@pytest.fixture(scope="module")
def pool():
    with open_executor("processes", 2) as executor:
        yield executor


@pytest.fixture
def store(tmp_path):
    with Store(tmp_path / "runs.db") as opened:
        yield opened


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


def spin(seconds):
    return busy({"seconds": seconds})


def test_a_call_within_its_time_gives_what_it_gives():
    assert call_within(None, lambda: 3) == 3
    assert call_within(LONG, lambda: 3) == 3
    with pytest.raises(ZeroDivisionError):
        call_within(LONG, lambda: 1 / 0)


def test_a_call_beyond_its_time_is_stopped():
    begun = time.perf_counter()
    with pytest.raises(TimeLimitExceeded):
        call_within(0.05, lambda: spin(LONG))
    assert 0.05 <= time.perf_counter() - begun < LONG / 2


@pytest.fixture
def restless():
    """Threads take turns as often as they can, so that a timer meets its call's end in every way there is."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def stopped(limit, call):
    """Whether the call is stopped; what is left of the exception would be raised in the loop that follows."""
    try:
        call_within(limit, call)
    except TimeLimitExceeded:
        return True
    finally:
        spin(1e-4)
    return False


@pytest.mark.usefixtures("restless")
def test_nothing_arrives_after_a_call_that_ends_when_its_time_does():
    ends = {stopped(5e-4 + number * 4e-6, lambda: spin(1e-3)) for number in range(250)}
    assert ends == {True, False}


def test_nothing_is_raised_while_the_timer_starts(monkeypatch):
    """It would leave a lock unbalanced, which says so in place of the limit."""
    through, start = [], threading.Thread.start

    def slow(thread):
        start(thread)
        spin(5e-3)
        through.append(thread)

    monkeypatch.setattr(threading.Thread, "start", slow)
    with pytest.raises(TimeLimitExceeded):
        call_within(1e-4, lambda: spin(LONG))
    assert len(through) == 1


@pytest.mark.usefixtures("restless")
def test_nothing_arrives_after_a_call_that_could_not_be_stopped():
    assert {stopped(1e-3, partial(time.sleep, 2e-2)) for _ in range(20)} == {True}


TRACED = """
import sys
import time
from multiphi_exudyn.study.sweep.time_limit import TimeLimitExceeded, call_within

def work():
    return 3

def forever():
    while True:
        pass

for limit, call in ((60.0, work), (0.05, forever), (0.05, lambda: time.sleep(0.2))):
    try:
        call_within(limit, call)
    except TimeLimitExceeded:
        pass
    sys.settrace(lambda frame, event, argument: None)
    work()
    sys.settrace(None)
"""


def test_a_debugger_can_follow_what_comes_after_a_call():
    """An interpreter of version 3.11 that believes an exception to be under way never gets past a traced function."""
    subprocess.run([sys.executable, "-c", TRACED], timeout=LONG, check=True)


def test_ctrl_c_is_not_taken_for_a_time_limit_that_arrives_at_the_same_time():
    program = """
import os, signal, threading, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in what a shell has put into the background
from multiphi_exudyn.study.sweep.time_limit import call_within
threading.Timer(0.3, os.kill, [os.getpid(), signal.SIGINT]).start()
call_within(0.1, lambda: time.sleep(0.6))
"""
    ended = subprocess.run([sys.executable, "-c", program], timeout=LONG, capture_output=True, text=True, check=False)
    assert ended.stderr.rstrip().endswith("KeyboardInterrupt")


def test_the_timer_ends_with_the_call():
    for _ in range(50):
        call_within(LONG, lambda: None)
    until = time.perf_counter() + 10
    while any(thread.name == "time limit" for thread in threading.enumerate()) and time.perf_counter() < until:
        time.sleep(0.001)
    assert not any(thread.name == "time limit" for thread in threading.enumerate())


def limited_rows(store, executor):
    cases = grid({"seconds": [0.0, LONG]})
    return [sweep(run, cases, store, run.__name__, executor=executor, budget_s=0.1) for run in (busy, converts)]


@pytest.mark.parametrize("where", ["here", "serial", "threads", "processes"])
def test_the_budget_holds_in_every_executor(store, pool, where):
    with ThreadPoolExecutor(1) as threads, open_executor("serial") as serial:
        executor = {"here": None, "serial": serial, "threads": threads, "processes": pool}[where]
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


def test_a_run_that_could_not_be_stopped_is_over_budget_when_it_ends(store):
    (row,) = sweep(lambda case: time.sleep(0.1), [{}], store, "sleep", budget_s=0.05)
    assert row.status == "over budget"
    assert row.elapsed_s >= 0.1


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


def test_workers_that_cannot_start_end_the_sweep_and_no_case_fails(store, monkeypatch):
    monkeypatch.setattr("multiphi_exudyn.study.sweep.executors._start_worker", sys.exit)
    with pytest.raises(MultiPhiError, match="die at the start"), WorkerPool(1) as executor:
        sweep(square, [{"x": 1}], store, "pass", executor=executor)
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
    monkeypatch.setattr("multiphi_exudyn.study.sweep.executors.ANSWER_S", 0.5)
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
        limited = limited_rows(store, executor)
        (died,) = sweep(dies, [{"x": 1, "fatal": [1]}], store, "dies", executor=executor)
    assert told(rows) == told(sweep(square, cases, store, "here"))
    assert [row.status for pair in limited for row in pair] == ["ok", "over budget"] * 2
    assert (died.status, died.message) == ("failed", "worker process died")
