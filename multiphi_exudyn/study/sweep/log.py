"""Write-ahead log of a store's file: which transactions it holds, so that none is lost without a word.

A header of 32 bytes: magic number, version, page size, sequence, salt (8), checksum (8); then frames, each 24 bytes:
page number, 0 or the file's pages after a commit, salt (8), checksum (8); and a page. SQLite takes frames as long as
salt and checksum are right, and drops what follows. Source: https://www.sqlite.org/fileformat2.html#walformat
"""

from __future__ import annotations

import collections
import struct
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Log", "read_log"]

HEADER, FRAME = 32, 24  # bytes
ORDERS = {b"\x37\x7f\x06\x82": "<", b"\x37\x7f\x06\x83": ">"}  # magic number -> of the words in a checksum
WORD = 2**32


@dataclass(frozen=True)
class Log:
    """salt: of the frames that count, older ones having another; commits: numbers, from 1, of those that commit."""

    salt: bytes
    commits: tuple[int, ...]

    def lost(self, read: int) -> int:
        """How many transactions are not among the first ``read`` frames."""
        return sum(commit > read for commit in self.commits)


def read_log(store: Path, page: int) -> Log:
    """The log beside a store with pages of so many bytes; empty where there is none."""
    try:
        content = store.with_name(f"{store.name}-wal").read_bytes()
    except FileNotFoundError:
        return Log(b"", ())
    heads = [content[start : start + FRAME] for start in range(HEADER, len(content) - FRAME - page + 1, FRAME + page)]
    salts = [head[8:16] for head in heads]
    usual = collections.Counter(salts).most_common(1)
    salt = content[16:24] if _is_sound(content[:HEADER]) or not usual else usual[0][0]
    given = enumerate(zip(heads, salts, strict=True), start=1)
    return Log(salt, tuple(number for number, (head, own) in given if own == salt and any(head[4:8])))


def _is_sound(header: bytes) -> bool:
    """Whether magic number and checksum, of the first 24 bytes, are right."""
    order = ORDERS.get(header[:4])
    if order is None or len(header) < HEADER:
        return False
    first = second = 0
    for one, other in struct.iter_unpack(f"{order}II", header[:24]):
        first = (first + one + second) % WORD
        second = (second + other + first) % WORD
    return header[24:] == struct.pack(">II", first, second)
