"""Cache of compiled functions: one file for this package, this machine and these versions.

    header: a hash of the rest   rest: {symbol: (digest of the function, its object file)}

Functions with another digest, damaged files, files of another machine, and folders that cannot be read are ignored. A
file is replaced as a whole, so that a process that reads it meanwhile gets the old one or the new one.
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

__all__ = ["StoredObjects", "cache_folders", "cached_objects", "file_name", "store_objects", "writable_folder"]

StoredObjects = dict[str, tuple[str, bytes]]  # symbol: (digest, object file)

PACKAGE = Path(__file__).parents[2]
HASH_SIZE = 32  # bytes
SETTINGS = ("CPU_NAME", "CPU_FEATURES", "ENABLE_AVX")  # NUMBA_...
LAYOUT = 2  # version of the file's layout and of the calls between functions


def _hash(content: bytes, size: int = HASH_SIZE) -> bytes:
    return hashlib.blake2b(content, digest_size=size).digest()


@functools.cache
def file_name() -> str:
    """Return the name of the file for this machine, the installed versions and numba's settings."""
    from multiphi_exudyn.mathematics.compiling.machine_code import this_cpu

    versions = [importlib.metadata.version(name) for name in ("numba", "llvmlite")]
    settings = [os.environ.get(f"NUMBA_{name}") for name in SETTINGS]
    parts = (LAYOUT, this_cpu(), versions, sys.version_info[:2], settings)
    return f"compiled-{_hash(repr(parts).encode(), 8).hex()}.bin"


def cache_folders() -> list[Path]:
    """Return the folders of the file: NUMBA_CACHE_DIR alone if set, else the package and the user's folder."""
    place = f"multiphi_exudyn_{_hash(str(PACKAGE).encode(), 8).hex()}"  # one for each copy of the package
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        return [Path(chosen) / place]
    return [PACKAGE / "__pycache__", _user_cache() / place]


def _user_cache() -> Path:
    """Return the folder for caches of programs on this system."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))


def writable_folder() -> Path | None:
    """Return the first folder that can be written to, created if needed."""
    for folder in cache_folders():
        with contextlib.suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            if os.access(folder, os.W_OK):
                return folder
    return None


def cache_file() -> Path | None:
    """Return the file that is read, None if there is none."""
    return next((folder / file_name() for folder in cache_folders() if (folder / file_name()).exists()), None)


def cached_objects(digests: Mapping[str, str]) -> dict[str, bytes]:
    """Return the cached object files, by symbol, of functions with these digests."""
    objects = {}
    for folder in cache_folders():
        for symbol, (digest, code) in _read(folder / file_name()).items():
            if digests.get(symbol) == digest:
                objects[symbol] = code
    return objects


def _read(path: Path) -> StoredObjects:
    """Return the content of a file, nothing if it is damaged or of another kind."""
    try:
        content = path.read_bytes()
    except OSError:
        return {}
    header, rest = content[:HASH_SIZE], content[HASH_SIZE:]
    return pickle.loads(rest) if header == _hash(rest) else {}


def store_objects(functions: StoredObjects) -> Path | None:
    """Add functions to the file; return its path, None where no folder can be written to."""
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
