"""Where compiled functions are kept: one file for this package, this machine and these versions.

    header: a hash of the rest   rest: {symbol: (digest of the function, its object file)}

A function whose digest is another one, a file that is damaged or of another machine, and a folder that cannot be read
count as not there. A file is replaced whole, so that whoever reads it meanwhile has the old one or the new one.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.metadata
import os
import pickle
import sys
from collections.abc import Mapping
from pathlib import Path

__all__ = ["Kept", "cache_folders", "file_name", "keep", "kept", "writable_folder"]

Kept = dict[str, tuple[str, bytes]]  # symbol: (digest, object file)

PACKAGE = Path(__file__).parents[2]
HASH_SIZE = 32  # bytes
SETTINGS = ("CPU_NAME", "CPU_FEATURES", "ENABLE_AVX")  # NUMBA_...
LAYOUT = 2  # of the file, and of how functions call one another: another number for another one


def _hash(content: bytes, size: int = HASH_SIZE) -> bytes:
    return hashlib.blake2b(content, digest_size=size).digest()


@functools.cache
def file_name() -> str:
    """The name of the file for this machine, the installed versions and numba's settings."""
    from multiphi_exudyn.mathematics.compiling.machine_code import this_cpu

    versions = [importlib.metadata.version(name) for name in ("numba", "llvmlite")]
    settings = [os.environ.get(f"NUMBA_{name}") for name in SETTINGS]
    parts = (LAYOUT, this_cpu(), versions, sys.version_info[:2], settings)
    return f"compiled-{_hash(repr(parts).encode(), 8).hex()}.bin"


def cache_folders() -> list[Path]:
    """Where the file may be: NUMBA_CACHE_DIR alone if it is set, else in the package, else in the user's folder."""
    place = f"multiphi_exudyn_{_hash(str(PACKAGE).encode(), 8).hex()}"  # another copy of the package has its own
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        return [Path(chosen) / place]
    return [PACKAGE / "__pycache__", _user_cache() / place]


def _user_cache() -> Path:
    """Where programs keep what they can make again, as this system has it."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))


def writable_folder() -> Path | None:
    """The first folder that can be written to; it is made."""
    for folder in cache_folders():
        with contextlib.suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            if os.access(folder, os.W_OK):
                return folder
    return None


def cache_file() -> Path | None:
    """The file that is read, None if there is none."""
    return next((folder / file_name() for folder in cache_folders() if (folder / file_name()).exists()), None)


def kept(wanted: Mapping[str, str]) -> dict[str, bytes]:
    """The object files of those functions, by symbol, that are kept with the digest that is wanted."""
    found = {}
    for folder in cache_folders():
        for symbol, (digest, code) in _read(folder / file_name()).items():
            if wanted.get(symbol) == digest:
                found[symbol] = code
    return found


def _read(path: Path) -> Kept:
    """What a file holds, nothing if it is none of ours or damaged."""
    try:
        content = path.read_bytes()
    except OSError:
        return {}
    header, rest = content[:HASH_SIZE], content[HASH_SIZE:]
    return pickle.loads(rest) if header == _hash(rest) else {}


def keep(functions: Kept) -> Path | None:
    """Put functions in the file, beside the others that are there; the path, None where nothing can be written."""
    folder = writable_folder()
    if folder is None:
        return None
    rest = pickle.dumps(_read(folder / file_name()) | functions)
    unfinished = folder / f"{file_name()}.{os.getpid()}.tmp"
    try:
        unfinished.write_bytes(_hash(rest) + rest)
        return unfinished.replace(folder / file_name())
    except OSError:  # a full disk, or Windows while another process reads
        unfinished.unlink(missing_ok=True)
        return None
