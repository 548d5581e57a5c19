"""Machine, versions, and import times of the packages."""

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

__all__ = ["environment", "import_times", "load_average", "machine"]

PACKAGES = ("multiphi-exudyn", "exudyn", "numpy", "scipy")
IMPORTED = ("multiphi_exudyn", "exudyn")
IMPORT_LIMIT_S = 60  # s; an import that takes longer is not reported


def environment() -> dict[str, Any]:
    """Machine and versions, and the date."""
    return {"date": datetime.now(timezone.utc).isoformat(timespec="seconds"), **machine()}


def import_times() -> dict[str, float | None]:
    """Import time [s] of each package with all its public names in a new interpreter; None for a failure."""
    return {name: _import_time(name) for name in IMPORTED}


def load_average() -> float | None:
    """Load average of the machine over the last minute; None where the system has none."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None


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
    """Name of the processor, or "unknown"."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "unknown")


def _import_time(module: str) -> float | None:
    """Time [s] to import all public names of a module, some of which are loaded lazily."""
    code = f"import time; t = time.perf_counter(); from {module} import *; print(time.perf_counter() - t)"
    path = os.pathsep.join(filter(None, sys.path))
    try:
        process = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            timeout=IMPORT_LIMIT_S,
            check=True,
            env=os.environ | {"PYTHONPATH": path},
        )
        return float(process.stdout.split()[-1])
    except (subprocess.SubprocessError, ValueError, IndexError, OSError):
        return None
