"""Functions on flat buffers: compiled, they are what they are in Python; what is compiled is kept, and never stale."""

from __future__ import annotations

import cmath
import importlib
import math
import multiprocessing
import os
import pickle
import subprocess
import sys
from pathlib import Path
from types import FunctionType

import numpy as np
import pytest

from multiphi_exudyn import cli
from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiWarning
from multiphi_exudyn.mathematics.compiling import compiled as front
from multiphi_exudyn.mathematics.compiling import compiled_cache
from multiphi_exudyn.mathematics.compiling.compiled import Entry, Ints, Numbers, Waves, compiled

pytest.importorskip("numba")
compilation = importlib.import_module("multiphi_exudyn.mathematics.compiling.compilation")

HALF = 0.5
FIRST, SECOND = 1, 2
NOTHING = np.zeros(1)


@compiled
def square(numbers: Numbers, k: int) -> float:
    return numbers[k] * numbers[k]


@compiled
def turn(numbers: Numbers, waves: Waves, n: int) -> None:
    for k in range(n):
        waves[k] = cmath.exp(complex(0.0, numbers[k])) * waves[k]


@compiled
def total(ints: Ints, numbers: Numbers, waves: Waves, n: int, start: float) -> float:
    found = start
    turn(numbers, waves, n)
    for k in range(n):
        found += HALF * square(numbers, ints[k]) + max(waves[k].imag, 0.0) + math.sqrt(abs(waves[k]))
    ints[0] = n // 2
    return found


@compiled
def falling(ints: Ints, n: int) -> int:
    while n > 0 and ints[n - 1] > ints[n]:
        n -= 1
    return n


@compiled
def chosen(ints: Ints, numbers: Numbers) -> float:
    place, found = FIRST + SECOND, 0.0
    if ints[0] > FIRST:
        place = SECOND
        place += FIRST + SECOND
    for k in range(ints[FIRST + SECOND]):
        found = numbers[place - FIRST] if k == SECOND else found + SECOND
        place = FIRST
    last = SECOND
    last = ints[last]
    return found + place / SECOND + (last + FIRST)


@compiled
def ratio(numbers: Numbers) -> float:
    return numbers[0] / numbers[1]


@compiled
def power_of_two_above(value: float) -> float:
    return math.ldexp(1.0, math.frexp(value)[1])


@compiled
def complex_ratio(waves: Waves) -> None:
    waves[0] = waves[1] / waves[2]


@compiled
def of_arrays(numbers: Numbers) -> float:
    return numbers[0] * NOTHING[0]


@compiled
def of_a_list(numbers: Numbers, n: int) -> float:
    found = [numbers[k] for k in range(n)]
    return found[0]


@compiled
def endless(n: int) -> int:
    return endless(n - 1)


@compiled
def without_kind(numbers: Numbers, n) -> float:
    return numbers[n]


@compiled
def of_a_wave(wave: complex) -> float:
    return wave.real


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """An empty place for what is compiled, and no entries but those that the test makes."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(front, "_entries", [])
    return tmp_path / "cache"


@pytest.fixture
def made(monkeypatch):
    """The names of the functions that were compiled."""
    names: list[str] = []

    def noted(functions):
        names.extend(function.__name__ for function in functions)
        return compile_functions(functions)

    compile_functions = compilation.compile_functions
    monkeypatch.setattr(compilation, "compile_functions", noted)
    return names


def buffers() -> tuple[np.ndarray, ...]:
    return np.array([3, 0, 2, 1]), np.linspace(0.1, 2.0, 4), np.arange(4) * (1.0 - 0.5j)


SOURCE = """
from multiphi_exudyn.mathematics.compiling.compiled import Numbers, compiled, entry
FACTOR = 2.0
@compiled
def scaled(numbers: Numbers, k: int) -> float:
    return numbers[k] * FACTOR
@compiled
def inner(numbers: Numbers, n: int) -> float:
    found = 0.0
    for k in range(n):
        found += scaled(numbers, k)
    return found
@compiled
def outer(numbers: Numbers) -> float:
    return inner(numbers, 3)
run = entry(outer)
"""


def program(*edits: tuple[str, str]) -> Entry:
    """The entry of ``SOURCE`` after edits, as a new process would have it."""
    source = SOURCE
    for old, new in edits:
        assert old in source
        source = source.replace(old, new)
    names = {"__name__": "program"}
    front._entries.clear()
    exec(source, names)
    return names["run"]


ONES = np.ones(4)


def test_a_compiled_function_and_what_it_calls_are_what_they_are_in_python():
    plain, fast = buffers(), buffers()
    assert Entry(total)(*fast, 4, 1.5) == pytest.approx(total(*plain, 4, 1.5), rel=1e-15)
    for of_plain, of_fast in zip(plain, fast, strict=True):
        np.testing.assert_allclose(of_fast, of_plain, rtol=1e-15)


def test_a_compiled_function_returns_an_integer_or_nothing():
    ints = np.array([0, 9, 7, 5])
    assert Entry(falling)(ints, 3) == falling(ints, 3) == 1
    assert Entry(turn)(*buffers()[1:], 2) is None


@pytest.mark.parametrize(("first", "count"), [(0, 0), (0, 1), (3, 3), (0, 4)])
def test_variables_that_take_constants_of_the_module_have_their_values_in_turn(first, count):
    given = np.array([first, 0, 7, count]), np.arange(8.0)
    assert Entry(chosen)(*given) == chosen(*given)


def test_a_number_is_taken_apart_and_put_together_as_in_python():
    for value in (0.75, -3.0, 1e-310, 1e300):
        assert Entry(power_of_two_above)(value) == power_of_two_above(value)


def test_a_division_by_zero_is_infinite_and_no_error():
    assert Entry(ratio)(np.array([1.0, 0.0])) == math.inf


def test_an_entry_sees_another_array_and_one_that_has_moved():
    run, numbers = Entry(square), np.array([3.0])
    assert run(numbers, 0) == 9.0
    assert run(np.array([4.0]), 0) == 16.0
    assert run(numbers, 0) == run(numbers, 0) == 9.0
    for size in (100_000, 1_000_000):
        numbers.resize(size, refcheck=False)
        assert run(numbers, 0) == run(numbers, 0) == 9.0
        assert run(numbers, size - 1) == 0.0
    assert run(pickle.loads(pickle.dumps(numbers)), 0) == 9.0


def test_an_entry_bound_to_its_buffers_takes_the_rest_and_sees_what_they_then_hold():
    ints, numbers, waves = buffers()
    bound = Entry(total).bound(ints, numbers, waves)
    numbers *= 2.0
    assert bound(4, 1.5) == pytest.approx(total(*buffers()[:1], 2 * buffers()[1], buffers()[2], 4, 1.5), rel=1e-15)
    with pytest.raises(MultiPhiTypeError, match="need a contiguous"):
        Entry(total).bound(ints, numbers[::2], waves)


def test_an_entry_keeps_no_array_alive():
    run, numbers = Entry(square), np.array([3.0])
    run(numbers, 0)
    before = sys.getrefcount(numbers)
    run(np.array([4.0]), 0)
    assert sys.getrefcount(numbers) == before == 2


@pytest.mark.parametrize(
    ("argument", "got"),
    [
        (np.array([1, 2]), "int64"),
        (np.zeros(8)[::2], "float64"),
        ([1.0, 2.0], "list"),
        (np.broadcast_to(1.0, 3), "float64"),
        (np.asfortranarray(np.zeros((2, 3))), "float64"),
        (np.frombuffer(bytearray(25), offset=1), "float64"),  # not aligned
        (np.zeros(3, ">f8"), ">f8"),
        (np.float64(1.0), "float64"),
        (bytearray(8), "bytearray"),
    ],
)
def test_an_entry_refuses_what_is_no_buffer_of_its_kind(argument, got):
    with pytest.raises(MultiPhiTypeError, match=f"square: .*got {got}.*need a contiguous, writable array of float64"):
        Entry(square)(argument, 0)


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (complex_ratio, "got an operation that raises"),
        (of_arrays, "got NOTHING of type ndarray"),
        (of_a_list, "arrays, lists"),
        (endless, "got a recursion"),
        (without_kind, "annotations: got without_kind"),
        (of_a_wave, "annotations: got of_a_wave"),
    ],
)
def test_what_cannot_be_compiled_is_refused_with_its_reason(function, message):
    with pytest.raises(MultiPhiTypeError, match=message):
        Entry(function).native()


def test_what_is_compiled_is_loaded_from_the_disk_by_the_next_process(made, capsys):
    assert program()(ONES) == 6.0
    assert made == ["scaled", "inner", "outer"]
    assert capsys.readouterr().err == "compiling the loop: about 2 s, once on this machine\n"
    assert program()(ONES) == 6.0
    assert len(made) == 3
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("edit", "again", "value"),
    [
        (("numbers[k] * FACTOR", "numbers[k] + FACTOR"), ["scaled"], 9.0),
        (("FACTOR = 2.0", "FACTOR = 5.0"), ["scaled"], 15.0),
        (("range(n)", "range(1, n)"), ["inner"], 4.0),
        (("inner(numbers, 3)", "inner(numbers, 4)"), ["outer"], 8.0),
        (("k: int", "k: float) -> float:\n    return FACTOR\ndef unused(k: int"), ["scaled", "inner"], 6.0),
    ],
)
def test_an_edit_of_a_function_a_constant_or_a_signature_is_seen(made, edit, again, value):
    program()(ONES)
    made.clear()
    assert program(edit)(ONES) == value
    assert made == again
    assert program(edit)(ONES) == value
    assert made == again


def test_the_first_call_compiles_what_every_entry_needs(made):
    run, other = program(), front.entry(square)
    assert run(ONES) == 6.0
    assert sorted(made) == ["inner", "outer", "scaled", "square"]
    assert other(np.array([3.0]), 0) == 9.0
    assert len(made) == 4


def test_two_programs_share_what_both_reach(made):
    program()(ONES)
    made.clear()
    names = {"__name__": "program"}
    exec(SOURCE.replace("entry(outer)", "entry(inner)"), names)
    assert names["run"](ONES, 2) == 4.0
    assert made == []


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: content[: len(content) // 2],
        lambda content: content[:-100] + bytes(100),
        lambda content: b"something else",
        lambda content: b"",
    ],
)
def test_a_damaged_file_is_compiled_again(made, damage):
    program()(ONES)
    path = compiled_cache.cache_file()
    path.write_bytes(damage(path.read_bytes()))
    assert program()(ONES) == 6.0
    assert len(made) == 6
    assert program()(ONES) == 6.0
    assert len(made) == 6


@pytest.fixture
def two_processes(monkeypatch):
    """Work that is shared between two processes, however little it is."""
    monkeypatch.setattr(compilation, "WORTH_A_PROCESS", 0.01)
    monkeypatch.setattr(compilation, "PROCESS_START", 0.0)
    monkeypatch.setattr(compilation, "_most_processes", lambda: 2)


def test_a_few_lines_are_compiled_by_one_process(monkeypatch):
    monkeypatch.setattr(compilation, "_most_processes", lambda: 2)
    assert len(compilation.work_shares([square, turn, total])) == 1


@pytest.mark.usefixtures("two_processes")
def test_processes_share_out_functions_by_their_work(monkeypatch):
    elsewhere, compile_in_process = [], compilation.compile_in_process
    monkeypatch.setattr(
        compilation, "compile_in_process", lambda share: elsewhere.append(compile_in_process(share)) or elsewhere[-1]
    )
    assert compilation.work_shares([square, turn, total]) == [[total], [turn, square]]
    assert Entry(total)(*buffers(), 4, 1.5) == pytest.approx(total(*buffers(), 4, 1.5), rel=1e-15)
    assert [set(compiled_there) for compiled_there in elsewhere] == [{turn, square}]


def test_sharing_out_costs_a_look_at_every_function(monkeypatch):
    looked_at = []
    monkeypatch.setattr(compilation, "line_count", lambda function: looked_at.append(function) or 100)
    monkeypatch.setattr(compilation, "_most_processes", lambda: 2)
    compilation._seconds.cache_clear()
    functions = [FunctionType((lambda: 0).__code__, {}) for _ in range(40)]
    own_share, other_share = compilation.work_shares(functions)
    assert len(looked_at) == 40
    assert len(other_share) < len(own_share) < 40  # another process has to start first
    compilation._seconds.cache_clear()


@pytest.mark.usefixtures("two_processes")
def test_what_another_process_cannot_import_is_compiled_here():
    run = program()
    assert compilation.compile_in_process([run.function]) == {}
    assert run(ONES) == 6.0


def test_without_a_folder_that_can_be_written_every_process_compiles_and_says_so(made, monkeypatch, tmp_path, capsys):
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file" / "cache"))
    for times in (1, 2):
        assert program()(ONES) == 6.0
        assert len(made) == 3 * times
        assert "in every process: no folder to keep it in is writable" in capsys.readouterr().err


def test_the_place_is_the_one_named_or_the_package_or_the_users_folder(monkeypatch, tmp_path):
    assert [path.parent for path in compiled_cache.cache_folders()] == [tmp_path / "cache"]
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    package = Path(front.__file__).parents[2]
    assert compiled_cache.cache_folders()[0] == package / "__pycache__"
    assert len(compiled_cache.cache_folders()) == 2


def test_where_the_package_cannot_be_written_the_users_folder_serves_and_both_are_read(made, monkeypatch, tmp_path):
    (tmp_path / "file").touch()
    monkeypatch.setattr(compiled_cache, "cache_folders", lambda: [tmp_path / "file" / "no", tmp_path / "user"])
    program()(ONES)
    assert compiled_cache.cache_file().parent == tmp_path / "user"
    program()(ONES)
    assert len(made) == 3


def test_another_setting_of_the_processor_is_another_file(monkeypatch):
    compiled_cache.file_name.cache_clear()
    names = {compiled_cache.file_name()}
    for name in ("generic", "x86-64-v2"):
        monkeypatch.setenv("NUMBA_CPU_NAME", name)
        compiled_cache.file_name.cache_clear()
        names.add(compiled_cache.file_name())
    compiled_cache.file_name.cache_clear()
    assert len(names) == 3


def test_numba_that_cannot_be_imported_leaves_the_plain_function_with_a_warning(monkeypatch):
    monkeypatch.setitem(sys.modules, "multiphi_exudyn.mathematics.compiling.compilation", None)
    with pytest.warns(MultiPhiWarning, match="runs as plain Python"):
        assert program()(ONES) == 6.0


def test_without_numba_an_entry_is_the_plain_function(monkeypatch):
    monkeypatch.setattr(front, "available", lambda: False)
    run = Entry(square)
    assert run.native() is run.plain
    assert run([3.0], 0) == 9.0


IN_A_PROCESS = """
import sys, numpy as np
from multiphi_exudyn.mathematics.compiling import compiled
compiled._entries.clear()
sys.path.insert(0, {folder!r})
from program import run
print(run(np.ones(4)), "numba" in sys.modules)
"""


def started(folder: Path) -> subprocess.Popen:
    """A process that runs ``SOURCE``."""
    (folder / "program.py").write_text(SOURCE)
    code = IN_A_PROCESS.format(folder=str(folder))
    return subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=dict(os.environ)
    )


def test_two_processes_compile_at_once_and_a_third_needs_no_numba(tmp_path):
    for process in [started(tmp_path), started(tmp_path)]:
        out, err = process.communicate(timeout=120)
        assert out == "6.0 True\n"
        assert err == "compiling the loop: about 2 s, once on this machine\n"
    assert started(tmp_path).communicate(timeout=120) == ("6.0 False\n", "")


def _child(queue: multiprocessing.Queue) -> None:
    queue.put(program()(ONES))


@pytest.mark.parametrize("method", multiprocessing.get_all_start_methods())
def test_a_child_process_runs_what_is_compiled(method):
    assert program()(ONES) == 6.0
    context = multiprocessing.get_context(method)
    queue = context.Queue()
    child = context.Process(target=_child, args=(queue,))
    child.start()
    assert queue.get(timeout=60) == 6.0
    child.join(60)


def test_the_command_line_compiles_ahead_and_says_where(monkeypatch, capsys):
    monkeypatch.setattr(front, "_entries", [program()])
    assert cli.main(["compile"]) == 0
    assert str(compiled_cache.cache_file()) in capsys.readouterr().out


def test_the_command_line_compiles_what_runs_samples_ledgers_and_coupled_bodies_need():
    code = """
from multiphi_exudyn.cli import compile_command
from multiphi_exudyn.mathematics.compiling import compiled
print(*sorted(one.function.__name__ for one in compiled._entries))
"""
    names = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert names == [
        "advance",
        "align_signs",
        "clear",
        "closed_form",
        "copy_factors",
        "gather",
        "integrate",
        "integrate_works",
        "is_far",
        "largest_product_error",
        "map_to_defects",
        "measure",
        "project",
        "remove_direction",
        "roots",
        "sample_rows",
        "sample_sizes",
        "sample_states",
        "set_reached",
        "single_direction_response",
        "step_is_clear",
        "unfold",
        "write_gaps_and_strain",
        "write_level",
        "write_rows",
        "write_signals",
        "write_span",
    ]


def test_the_command_line_fails_where_nothing_is_kept(monkeypatch, capsys, tmp_path):
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file" / "cache"))
    monkeypatch.setattr(front, "_entries", [program()])
    assert cli.main(["compile"]) == 1
    assert "no folder is writable" in capsys.readouterr().err
