"""The file of finished runs: one row of SQLite for each run, there as a whole or not at all.

    key of a run = (name of the sweep, sha256 of its parameters as JSON, sorted, without blanks, 1 unlike 1.0)

Every row is a transaction of its own. A process that is killed at any moment leaves the row or nothing, processes of
one machine may write into one file at the same time, and the second run with the same key is not stored.

A damaged file is refused, never read in part: pages and indices are checked by SQLite when the file is opened and when
all rows are asked for, the rows are numbered without gaps, and each has a checksum of what it holds. Nothing is
repaired, since what a damaged file still holds cannot be told from what it has lost.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import math
import sqlite3
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError

__all__ = ["STATUSES", "Row", "Store", "checked", "key_of", "pack", "plain"]

STATUSES = ("ok", "failed", "over budget")
FORMAT = 3
MARK = int.from_bytes(b"mPhi", "big")  # SQLite's application id: what tells a store from other databases
WAIT_S = 60.0  # s, for another process that writes
FULL = "database or disk is full"  # SQLite's message
SCHEMA = """CREATE TABLE runs (
    number INTEGER PRIMARY KEY, name TEXT NOT NULL, key TEXT NOT NULL,
    content TEXT NOT NULL, histories BLOB, checksum TEXT NOT NULL, UNIQUE (name, key)
)"""  # content: the row as JSON; histories: a compressed npz file


@dataclass(frozen=True)
class Row:
    """How the run with these parameters ended.

    status: "ok", "failed" or "over budget"; message: the cause where it is not "ok". elapsed_s: s of wall clock.
    environment: machine and versions. finished: ISO 8601, UTC.
    """

    parameters: Mapping[str, Any]
    status: str
    message: str
    values: Mapping[str, Any]
    elapsed_s: float
    environment: Mapping[str, Any]
    finished: str


class Store:
    """Runs under their names in the file ``path``, which is made where there is none."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        try:
            self._connection = sqlite3.connect(self.path, timeout=WAIT_S, isolation_level=None)
        except sqlite3.Error as error:
            raise self._unusable(f"cannot be opened ({error})") from error
        try:
            with self._sound():
                self._prepare()
                self._check()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    def rows(self, name: str) -> tuple[Row, ...]:
        """All runs of ``name``, in the order in which they were added."""
        with self._sound():
            self._check()
            found = self._connection.execute(
                "SELECT name, key, content, checksum FROM runs WHERE name = ? ORDER BY number", (name,)
            )
            return tuple(_row(*columns) for columns in found)

    def find(self, name: str, parameters: Mapping[str, Any]) -> Row | None:
        """The run with these parameters; None where it is not there."""
        with self._sound():
            columns = self._connection.execute(
                "SELECT name, key, content, checksum FROM runs WHERE name = ? AND key = ?", (name, key_of(parameters))
            ).fetchone()
            return None if columns is None else _row(*columns)

    def histories(self, name: str, parameters: Mapping[str, Any]) -> dict[str, np.ndarray] | None:
        """The run's arrays; None where none were kept."""
        with self._sound():
            found = self._connection.execute(
                "SELECT content, histories FROM runs WHERE name = ? AND key = ?", (name, key_of(parameters))
            ).fetchone()
            if found is None or json.loads(found[0])["histories"] is None:
                return None
            content, packed = found
            if not isinstance(packed, bytes) or _sha256(packed) != json.loads(content)["histories"]:
                raise _Damaged("the histories of a run are not those that were stored")
        with np.load(io.BytesIO(packed), allow_pickle=False) as arrays:
            return dict(arrays)

    def add(self, name: str, parameters: Mapping[str, Any], row: Row, histories: bytes | None = None) -> bool:
        """Keep a run; False, and the file as it was, where these parameters have a run already.

        histories: as :func:`pack` gives them.
        """
        if row.status not in STATUSES:
            raise MultiPhiValueError(f"row: status {row.status!r}; need one of {', '.join(STATUSES)}")
        key, given = key_of(parameters), {**vars(row), "parameters": checked(parameters)}
        given["histories"] = None if histories is None else _sha256(histories)
        content = json.dumps(plain(given, "row"))
        with self._sound():
            added = self._connection.execute(
                "INSERT INTO runs (name, key, content, histories, checksum) VALUES (?, ?, ?, ?, ?)"
                "ON CONFLICT DO NOTHING",
                (name, key, content, histories, _checksum(name, key, content)),
            )
            return added.rowcount == 1

    def _prepare(self) -> None:
        """Make the table of a new file; refuse a file of something else. One process at a time."""
        database = self._connection
        database.execute("BEGIN IMMEDIATE")
        with database:
            (mark,) = database.execute("PRAGMA application_id").fetchone()
            (version,) = database.execute("PRAGMA user_version").fetchone()
            new = database.execute("SELECT count(*) FROM sqlite_master").fetchone() == (0,)
            if mark == 0 and new:
                database.execute(SCHEMA)
                database.execute(f"PRAGMA application_id = {MARK}")
                database.execute(f"PRAGMA user_version = {FORMAT}")
            elif mark != MARK:
                raise self._unusable("is no store of runs")
            elif version != FORMAT:
                raise self._unusable(f"was written by another version (format {version}, this one reads {FORMAT})")

    def _check(self) -> None:
        """Raise an error for damaged pages or indices, or gaps in the numbers of the runs."""
        (result,) = self._connection.execute("PRAGMA integrity_check(1)").fetchone()
        if result != "ok":
            raise _Damaged(" ".join(str(result).split()))
        count, last = self._connection.execute("SELECT count(*), coalesce(max(number), 0) FROM runs").fetchone()
        if count != last:
            raise _Damaged(f"{count} runs where the last one has the number {last}")

    @contextlib.contextmanager
    def _sound(self) -> Iterator[None]:
        """Errors of SQLite in words."""
        try:
            yield
        except (sqlite3.Error, UnicodeDecodeError, _Damaged) as error:
            if FULL in str(error):
                kept = "what has finished is kept; make room and start again"
                raise MultiPhiValueError(f"path: {self.path}: the disk is full; {kept}") from error
            raise self._unusable(f"is damaged ({error})") from error

    def _unusable(self, cause: str) -> MultiPhiValueError:
        return MultiPhiValueError(
            f"path: {self.path}: {cause}; need a sound file of this library's sweeps (a copy of it), or a new name, "
            "under which all runs are computed again"
        )


class _Damaged(Exception):
    """Stored data have changed or are missing; the message says which."""


def _row(name: str, key: str, content: str, checksum: str) -> Row:
    if _checksum(name, key, content) != checksum:
        raise _Damaged("a run is not the one that was stored")
    fields = json.loads(content)
    del fields["histories"]
    return Row(**fields)


def _checksum(*columns: str) -> str:
    return _sha256(repr(columns).encode())


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def key_of(parameters: Mapping[str, Any]) -> str:
    """sha256 of the parameters' canonical JSON."""
    return _sha256(json.dumps(checked(parameters), sort_keys=True, separators=(",", ":"), allow_nan=False).encode())


def checked(parameters: Mapping[str, Any], place: str = "parameters") -> dict[str, Any]:
    """The parameters as JSON has them, all numbers finite."""
    if not isinstance(parameters, Mapping):
        raise MultiPhiTypeError(f"{place}: {type(parameters).__name__}; need a mapping from names to values")
    return plain(parameters, place, _refused)


def plain(value: Any, place: str, not_finite: Callable[[float, str], Any] = lambda value, place: None) -> Any:
    """``value`` as JSON has it: NumPy's numbers become Python's, tuples lists; ``not_finite`` answers for nan, inf."""
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else not_finite(value, place)
    if isinstance(value, (list, tuple)):
        return [plain(item, f"{place}[{index}]", not_finite) for index, item in enumerate(value)]
    if isinstance(value, Mapping) and all(isinstance(name, str) for name in value):
        return {str(name): plain(item, f"{place}[{name!r}]", not_finite) for name, item in value.items()}
    kind = "a mapping with names that are no text" if isinstance(value, Mapping) else type(value).__name__
    raise MultiPhiValueError(f"{place}: {kind}; need numbers, text, bool, None, lists and mappings of them")


def _refused(value: float, place: str) -> Any:
    raise MultiPhiValueError(f"{place}: {value}; need a finite number")


def pack(histories: Mapping[str, np.ndarray]) -> bytes:
    """The arrays as a compressed npz file; their names may be any, unlike those of np.savez."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in histories.items():
            with archive.open(f"{name}.npy", "w") as entry:
                np.lib.format.write_array(entry, np.asarray(array), allow_pickle=False)
    return buffer.getvalue()
