"""Where something ran: versions, machine, and what importing the packages costs."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import subprocess
import sys
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_info

__all__ = ["environment", "import_times", "machine"]

PACKAGES = ("multiphi-exudyn", "exudyn", "numpy", "scipy")
IMPORTED = ("multiphi_exudyn", "exudyn")
IMPORT_LIMIT_S = 60  # s; an import that takes longer is not reported


def environment() -> dict[str, Any]:
    """Machine and versions, and the date."""
    return {"date": datetime.now(timezone.utc).isoformat(timespec="seconds"), **machine()}


def import_times() -> dict[str, float | None]:
    """The time [s] that each package's public names take to load in a fresh interpreter; None where it fails."""
    return {name: _import_time(name) for name in IMPORTED}


def machine() -> dict[str, Any]:
    """Versions, machine and the number of threads of its linear algebra."""
    return {
        "python": platform.python_version(),
        "system": platform.platform(),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "threads": {"BLAS threads": max((pool["num_threads"] for pool in threadpool_info()), default=1)},
        "versions": {name: _version(name) for name in PACKAGES},
    }


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def _processor() -> str:
    """The processor's name where the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "unknown")


def _import_time(module: str) -> float | None:
    """Seconds until all public names of a module are there; some are loaded when they are asked for."""
    code = f"import time; t = time.perf_counter(); from {module} import *; print(time.perf_counter() - t)"
    path = os.pathsep.join(filter(None, sys.path))
    try:
        done = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            timeout=IMPORT_LIMIT_S,
            check=True,
            env=os.environ | {"PYTHONPATH": path},
        )
        return float(done.stdout.split()[-1])
    except (subprocess.SubprocessError, ValueError, IndexError, OSError):
        return None
