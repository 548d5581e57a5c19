"""File of finished runs: each is one row, there as a whole or not at all.

SQLite, one transaction per run (its environment, which many runs share, is there before). Journal: write-ahead log, so
that a commit is one append to a second file, readers and a writer do not wait for each other, and a process killed at
any moment leaves either the run or nothing. Synchronous NORMAL: a commit does not wait for the disk. What the system
holds outlives a killed process; a power failure may take the last runs, never the file, and those are then computed
again. The log needs memory that its users share: all who write into one file are on one machine (workers elsewhere are
not concerned, they hand their rows back).

A file that was damaged is refused, never read in part: SQLite's own check of all pages and indices and the numbers of
the runs, which have no gaps, are looked at when it is opened and when all runs are asked for; what a run is read from
has to have the sha256 that was stored with it. Nothing is repaired: what a damaged file still holds cannot be told
from what it has lost. Runs at the end of the log that cannot be read are lost as after a power failure; a
MultiPhiWarning says how many.

A run's key is (name, sha256 of its parameters' canonical JSON): sorted, without blanks, 1 and 1.0 being different.
A new file is made under a temporary name and linked to its own, so that no process sees an incomplete file.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import sqlite3
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError, MultiPhiWarning
from multiphi_exudyn.study.sweep.log import Log, read_log
from multiphi_exudyn.study.sweep.row import STATUSES, Row, checked, key_of, plain

__all__ = ["Store"]

FORMAT = 2
MARK = int.from_bytes(b"mPhi", "big")  # SQLite's application id, bytes 68 to 71 of the file
WAIT_S = 60.0  # s, for another process that writes
SCHEMA = f"""
PRAGMA journal_mode = WAL;
PRAGMA application_id = {MARK};
BEGIN;
CREATE TABLE format (version INTEGER NOT NULL);
INSERT INTO format VALUES ({FORMAT});
CREATE TABLE environments (number INTEGER PRIMARY KEY, content TEXT NOT NULL UNIQUE);
CREATE TABLE runs (
    number INTEGER PRIMARY KEY, name TEXT NOT NULL, key TEXT NOT NULL, parameters TEXT NOT NULL, status TEXT NOT NULL,
    message TEXT NOT NULL, content TEXT NOT NULL, elapsed_s REAL NOT NULL, environment INTEGER NOT NULL,
    finished TEXT NOT NULL, histories BLOB, histories_sum TEXT, sum TEXT NOT NULL, UNIQUE (name, key)
);
COMMIT;
"""
SUMMED = ("name", "key", "parameters", "status", "message", "content", "elapsed_s", "finished", "histories_sum")
ROW = f"""SELECT {", ".join(f"runs.{column}" for column in SUMMED)}, environments.content, sum
FROM runs LEFT JOIN environments ON environments.number = environment WHERE name = ?"""


class Store:
    """Runs under their names in the file ``path``, which is made where there is none."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        if not self.path.exists():
            _create(self.path)
        self._environments: dict[str, int] = {}
        self._connection = _opened(self.path)

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
            _check(self._connection)
            return tuple(map(_row, self._connection.execute(f"{ROW} ORDER BY runs.number", (name,))))

    def find(self, name: str, parameters: Mapping[str, Any]) -> Row | None:
        """The run with these parameters; None where it is not there."""
        with self._sound():
            columns = self._connection.execute(f"{ROW} AND key = ?", (name, key_of(parameters))).fetchone()
            return None if columns is None else _row(columns)

    def histories(self, name: str, parameters: Mapping[str, Any]) -> dict[str, np.ndarray] | None:
        """The run's arrays; None where none were kept."""
        question = "SELECT histories, histories_sum FROM runs WHERE name = ? AND key = ?"
        with self._sound():
            found = self._connection.execute(question, (name, key_of(parameters))).fetchone()
            if found is None or found == (None, None):
                return None
            packed, checksum = found
            if not isinstance(packed, bytes) or hashlib.sha256(packed).hexdigest() != checksum:
                raise _Damaged("the histories of a run are not those that were stored")
        with np.load(io.BytesIO(packed), allow_pickle=False) as arrays:
            return dict(arrays)

    def add(self, name: str, parameters: Mapping[str, Any], row: Row, histories: bytes | None = None) -> bool:
        """Keep a run; False, and the file as it was, where these parameters have a run already.

        histories: as :func:`pack` gives them.
        """
        if row.status not in STATUSES:
            raise MultiPhiValueError(f"row: status {row.status!r}; need one of {', '.join(STATUSES)}")
        given, values = checked(parameters), plain(row.values, "values")
        fields: dict[str, Any] = {"name": name, "key": key_of(given), "parameters": json.dumps(given)}
        fields |= {"status": row.status, "message": row.message, "content": json.dumps(values)}
        fields |= {"elapsed_s": float(row.elapsed_s), "finished": row.finished}
        fields["histories_sum"] = None if histories is None else hashlib.sha256(histories).hexdigest()
        environment = json.dumps(plain(row.environment, "environment"), sort_keys=True)
        fields["sum"] = _sum(*(fields[column] for column in SUMMED), environment)
        with self._sound():
            fields |= {"environment": self._environment(environment), "histories": histories}
            places, marks = ", ".join(fields), ", ".join(f":{field}" for field in fields)
            order = f"INSERT INTO runs ({places}) VALUES ({marks}) ON CONFLICT DO NOTHING"
            return self._connection.execute(order, fields).rowcount == 1

    def _environment(self, content: str) -> int:
        """Number of the environment, which stands in the file once."""
        if content not in self._environments:
            self._connection.execute("INSERT INTO environments (content) VALUES (?) ON CONFLICT DO NOTHING", (content,))
            found = self._connection.execute("SELECT number FROM environments WHERE content = ?", (content,))
            self._environments[content] = found.fetchone()[0]
        return self._environments[content]

    @contextlib.contextmanager
    def _sound(self) -> Iterator[None]:
        try:
            yield
        except READING as error:
            if FULL in str(error):
                kept = "what has finished is kept; make room and start again"
                raise MultiPhiValueError(f"path: {self.path}: the disk is full; {kept}") from error
            raise _unusable(self.path, f"is damaged ({error})") from error


class _Damaged(Exception):
    """Stored data have changed or are missing; the message says which."""


FULL = "database or disk is full"  # SQLite's message
READING = (sqlite3.Error, UnicodeDecodeError, _Damaged)  # raised where a file is damaged


def _sum(*columns: Any) -> str:
    """sha256 of the columns of a run."""
    return hashlib.sha256(repr(columns).encode()).hexdigest()


def _row(fields: tuple[Any, ...]) -> Row:
    *columns, checksum = fields
    if _sum(*columns) != checksum:
        raise _Damaged("a run is not the one that was stored")
    _, _, parameters, status, message, values, elapsed_s, finished, _, environment = columns
    content = json.loads(parameters), json.loads(values), json.loads(environment)
    return Row(content[0], status, message, content[1], elapsed_s, content[2], finished)


def _check(connection: sqlite3.Connection) -> None:
    """Raise an error for damaged pages or indices, or gaps in the numbers of the runs."""
    (result,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
    if result != "ok":
        raise _Damaged(" ".join(str(result).split()))
    count, last = connection.execute("SELECT count(*), coalesce(max(number), 0) FROM runs").fetchone()
    if count != last:
        raise _Damaged(f"{count} runs where the last one has the number {last}")


def _warn_lost(path: Path, log: Log, connection: sqlite3.Connection) -> None:
    """Warn of transactions in the log, as it was before opening, that SQLite could not read."""
    _, read, _ = connection.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()
    page = connection.execute("PRAGMA page_size").fetchone()[0]
    if read >= 0 and log.commits and read_log(path, page).salt == log.salt and (lost := log.lost(read)):
        message = (
            f"lost runs: up to {lost} runs at the end of the log of {path} cannot be read (power failure or damage); "
            "a sweep computes them again, or take a copy of the file and of its log"
        )
        warnings.warn(message, MultiPhiWarning, stacklevel=4)


def _unusable(path: Path, cause: str) -> MultiPhiValueError:
    return MultiPhiValueError(
        f"path: {path}: {cause}; need a sound file of this library's sweeps (a copy of it), or a new name, under which "
        "all runs are computed again"
    )


def _create(path: Path) -> None:
    """An empty store at ``path``; another process may be quicker."""
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
            new = Path(folder) / path.name
            with contextlib.closing(sqlite3.connect(new)) as connection:
                connection.executescript(SCHEMA)
            with contextlib.suppress(FileExistsError):
                os.link(new, path)
    except (OSError, sqlite3.Error) as error:
        raise _unusable(path, f"cannot be made ({getattr(error, 'strerror', None) or error})") from error


def _opened(path: Path) -> sqlite3.Connection:
    """Connection to a store; the mark is read first, because SQLite may write into what it opens."""
    try:
        with path.open("rb") as file:
            head = file.read(72)
    except OSError as error:
        raise _unusable(path, f"cannot be read ({error.strerror})") from error
    if head[68:] != MARK.to_bytes(4, "big"):
        raise _unusable(path, "is no store of runs")
    log = read_log(path, int.from_bytes(head[16:18], "big") or 1)
    try:
        connection = sqlite3.connect(path, timeout=WAIT_S, isolation_level=None)
        try:
            connection.execute("PRAGMA synchronous = NORMAL")
            found = connection.execute("SELECT version FROM format").fetchall()
            if found != [(FORMAT,)]:
                versions = ", ".join(str(version) for (version,) in found)
                raise _unusable(path, f"has format {versions or 'none'}, this version reads {FORMAT}")
            _check(connection)
            _warn_lost(path, log, connection)
        except BaseException:
            connection.close()
            raise
    except READING as error:
        raise _unusable(path, f"is damaged ({error})") from error
    return connection
