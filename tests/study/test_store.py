"""The file of finished runs: whole rows only, each once, and no other file touched."""

import contextlib
import math
import sqlite3
import threading

import numpy as np
import pytest

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.study.store import pack
from multiphi_exudyn.study.sweep import Row, Store


def row(parameters, **fields):
    given = {"status": "ok", "message": "", "values": {"y": 1.5}, "elapsed_s": 0.25, "environment": {"host": "here"}}
    return Row(parameters=parameters, finished="2020-01-01T00:00:00.000+00:00", **given | fields)


@pytest.fixture
def store(tmp_path):
    with Store(tmp_path / "runs.db") as opened:
        yield opened


def test_what_is_added_is_found_after_reopening(store):
    rows = [row({"b": 1, "a": [1.5, None, {"c": "ü"}]}), row({"b": 2}, status="failed", message="cause", values={})]
    rows += [row({}, status="over budget", message="long", environment={"host": "there"})]
    assert all(store.add("pass", given.parameters, given) for given in rows)
    with Store(store.path) as again:
        assert again.rows("pass") == tuple(rows)
        assert [again.find("pass", given.parameters) for given in rows] == rows
        assert list(again.rows("pass")[0].parameters) == ["b", "a"]


def test_names_keep_rows_apart_and_a_key_is_there_once(store):
    given = {"x": 1, "y": 2.0}
    assert store.add("one", given, row(given))
    assert not store.add("one", {"y": 2.0, "x": 1}, row(given, values={"y": 7.0}))
    assert store.add("two", given, row(given, values={}))
    assert [found.values for found in store.rows("one")] == [{"y": 1.5}]
    assert store.find("two", given).values == {}
    assert store.find("three", given) is None
    assert store.rows("three") == ()


def test_the_key_sees_kinds_and_not_what_numpy_adds(store):
    store.add("pass", {"x": 1}, row({"x": 1}))
    assert store.find("pass", {"x": np.int64(1)})
    assert store.find("pass", {"x": 1.0}) is None
    assert store.find("pass", {"x": True}) is None
    assert store.find("pass", {"x": "1"}) is None
    store.add("pass", {"x": np.float64(0.1), "y": (1, 2)}, row({}))
    assert store.find("pass", {"y": [1, 2], "x": 0.1}).parameters == {"x": 0.1, "y": [1, 2]}


def test_what_is_not_finite_is_none_among_the_values(store):
    store.add("pass", {}, row({}, values={"y": math.nan, "z": [math.inf, np.float32(0.5)], "n": np.int64(3)}))
    assert store.find("pass", {}).values == {"y": None, "z": [None, 0.5], "n": 3}


def test_histories_come_back_bit_by_bit(store):
    arrays = {"u/tip": np.random.default_rng(1).normal(size=(50, 2)), "file": np.arange(3), "empty": np.zeros((0, 2))}
    arrays |= {"open": np.array([True, False])}
    store.add("pass", {"x": 1}, row({"x": 1}), pack(arrays))
    store.add("pass", {"x": 2}, row({"x": 2}))
    found = store.histories("pass", {"x": 1})
    assert list(found) == list(arrays)
    assert all(found[name].dtype == arrays[name].dtype for name in arrays)
    assert all(np.array_equal(found[name], arrays[name]) for name in arrays)
    assert store.histories("pass", {"x": 2}) is None
    assert store.histories("pass", {"x": 3}) is None


@pytest.mark.parametrize(
    ("parameters", "begins"),
    [
        ({"x": math.nan}, "parameters['x']: nan"),
        ({"x": [1.0, -math.inf]}, "parameters['x'][1]: -inf"),
        ({"x": {"y": {1, 2}}}, "parameters['x']['y']: set"),
        ({"x": np.zeros(2)}, "parameters['x']: ndarray"),
        ({"x": 1j}, "parameters['x']: complex"),
        ({"x": {1: 2}}, "parameters['x']: a mapping with names that are no text"),
    ],
)
def test_parameters_that_json_does_not_have_are_refused(store, refused, parameters, begins):
    refused(ValueError, begins, store.find, "pass", parameters)
    refused(ValueError, begins, store.add, "pass", parameters, row({}))
    assert store.rows("pass") == ()


def test_an_unknown_status_and_parameters_that_are_no_mapping_are_refused(store, refused):
    refused(ValueError, "row: status 'good'", store.add, "pass", {}, row({}, status="good"))
    refused(TypeError, "parameters: list", store.find, "pass", [1])


def database(path, *orders):
    with contextlib.closing(sqlite3.connect(path)) as connection:
        connection.executescript("; ".join(orders))


def foreign_files(folder):
    """Files that are no store: text, another program's database, cut short, damaged, of another version."""
    (folder / "text").write_text("no database at all\n" * 100)
    database(folder / "database", "CREATE TABLE format (version)", "INSERT INTO format VALUES (1)")
    for name in ("short", "damaged", "version"):
        with Store(folder / name) as store:
            store.add("pass", {}, row({}))
    whole = (folder / "short").read_bytes()
    (folder / "short").write_bytes(whole[:5000])
    (folder / "damaged").write_bytes(whole[:200] + b"\xff" * (len(whole) - 200))
    database(folder / "version", "PRAGMA user_version = 99")
    return sorted(path for path in folder.iterdir() if path.is_file())


def test_a_file_that_is_no_store_is_refused_and_left_as_it_is(tmp_path, refused):
    paths = foreign_files(tmp_path)
    assert len(paths) == 5
    before = {path: path.read_bytes() for path in paths}
    for path in paths:
        refused(ValueError, f"path: {path}: ", Store, path)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def overwritten(whole, kind, seed):
    """The bytes with something random written over them: single ones, a stretch, nothings, a page by another one."""
    rng, content = np.random.default_rng(seed), bytearray(whole)
    begin, length = int(rng.integers(72, len(whole))), int(rng.integers(1, 9000))
    end = min(begin + length, len(whole))
    if kind == "bytes":
        content[begin] = int(rng.integers(256))
        for place in rng.integers(0, len(whole), int(rng.integers(0, 60))):
            content[place] = int(rng.integers(256))
    elif kind == "page":
        one, other = rng.integers(1, len(whole) // PAGE, 2) * PAGE
        content[one : one + PAGE] = whole[other : other + PAGE]
    else:
        content[begin:end] = rng.bytes(end - begin) if kind == "stretch" else bytes(end - begin)
    return bytes(content)


PAGE = 4096  # bytes of the file that SQLite reads at once


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """The bytes of a store with 100 runs, and its rows."""
    path = tmp_path_factory.mktemp("sound") / "runs.db"
    with Store(path) as store:
        for x in range(100):
            arrays = pack({"y": np.full(40, x)}) if x % 10 == 0 else None
            store.add("pass", {"x": x}, row({"x": x}, values={"y": 1.5 * x}, environment={"host": str(x % 3)}), arrays)
        rows = store.rows("pass")
    return path.read_bytes(), rows


def read(store):
    """All runs, each of them asked for alone, and their histories' means."""
    alone = tuple(store.find("pass", {"x": x}) for x in range(100))
    return store.rows("pass"), alone, [store.histories("pass", {"x": x})["y"].mean() for x in range(0, 100, 10)]


@pytest.mark.parametrize("kind", ["bytes", "stretch", "nothing", "page"])
def test_a_store_overwritten_at_random_is_refused_or_gives_every_run(tmp_path, sound, kind):
    whole, rows = sound
    said = []
    for seed in range(60):
        path = tmp_path / f"{seed}.db"
        path.write_bytes(overwritten(whole, kind, seed))
        try:
            with Store(path) as store:
                assert read(store) == (rows, rows, list(range(0, 100, 10))), f"seed {seed}"
        except MultiPhiValueError as error:
            said.append(str(error))
    assert len(said) >= 40
    assert all(sentence.startswith(f"path: {tmp_path}") and "\n" not in sentence for sentence in said)


def test_a_run_with_another_value_in_its_place_is_refused(tmp_path, sound, refused):
    changed = sound[0].replace(b'{"y": 75.0}', b'{"y": 76.0}')
    assert changed != sound[0]
    (tmp_path / "runs.db").write_bytes(changed)
    with Store(tmp_path / "runs.db") as store:
        assert store.find("pass", {"x": 49}) == sound[1][49]
        refused(ValueError, f"path: {store.path}: is damaged (a run is not", store.find, "pass", {"x": 50})
        refused(ValueError, f"path: {store.path}: is damaged (a run is not", store.rows, "pass")


def test_a_run_that_is_missing_in_page_and_index_is_noticed(tmp_path, sound, refused):
    (tmp_path / "runs.db").write_bytes(sound[0])
    database(tmp_path / "runs.db", "DELETE FROM runs WHERE number = 7")
    begins = f"path: {tmp_path / 'runs.db'}: is damaged (99 runs where the last one has the number 100)"
    refused(ValueError, begins, Store, tmp_path / "runs.db")


def test_a_full_disk_is_told_as_that_and_what_has_finished_is_kept(store):
    (pages,) = store._connection.execute("PRAGMA page_count").fetchone()
    store._connection.execute(f"PRAGMA max_page_count = {pages + 4}")

    def fill():
        for x in range(50):
            store.add("pass", {"x": x}, row({"x": x}), pack({"y": np.random.default_rng(x).random(1000)}))

    with pytest.raises(MultiPhiValueError, match=r"the disk is full.*make room and start again"):
        fill()
    kept = len(store.rows("pass"))
    assert 0 < kept < 50
    with Store(store.path) as again:
        assert [found.parameters["x"] for found in again.rows("pass")] == list(range(kept))
        assert again.add("pass", {"x": kept}, row({"x": kept}))


def test_a_folder_or_a_path_without_one_is_refused(tmp_path, refused):
    refused(ValueError, f"path: {tmp_path}: cannot be opened", Store, tmp_path)
    refused(ValueError, f"path: {tmp_path / 'no' / 'runs.db'}: cannot be opened", Store, tmp_path / "no" / "runs.db")


def test_many_open_a_new_file_at_once_and_write_into_it(tmp_path):
    path, together = tmp_path / "runs.db", threading.Barrier(8)
    added = []

    def work(number):
        together.wait()
        with Store(path) as store:
            added.extend(
                store.add("pass", {"x": x}, row({"x": x}, environment={"host": str(number)})) for x in range(20)
            )

    threads = [threading.Thread(target=work, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    with Store(path) as store:
        assert sorted(found.parameters["x"] for found in store.rows("pass")) == list(range(20))
    assert (len(added), sum(added)) == (160, 20)
    assert list(tmp_path.iterdir()) == [path]
