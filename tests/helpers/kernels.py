"""The same code on several kernels of the linear algebra library, each in a process of its own.

OpenBLAS chooses its kernels by the processor, or by OPENBLAS_CORETYPE; a name that it does not know is ignored.
"""

import functools
import os
import subprocess
import sys

import pytest

KERNELS = {"Prescott": {"Prescott", "Katmai"}, "Haswell": {"Haswell", "Zen"}, "SkylakeX": {"SkylakeX", "Cooperlake"}}
ASKED = (
    "import numpy, scipy.linalg, threadpoolctl\n"
    "print(*{info['architecture'] for info in threadpoolctl.threadpool_info() if info['user_api'] == 'blas'})\n"
)


def output_on(kernel: str, code: str) -> str:
    """What ``code`` prints on a kernel; the test is skipped where the processor does not have it."""
    if available(kernel) not in KERNELS[kernel]:
        pytest.skip(f"the processor, or the linear algebra library, has no kernel {kernel}")
    return _run(kernel, code)


@functools.cache
def available(kernel: str) -> str:
    """The kernel that runs where this one is asked for."""
    return _run(kernel, ASKED).strip()


def _run(kernel: str, code: str) -> str:
    environment = {**os.environ, "OPENBLAS_CORETYPE": kernel, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", code]
    found = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    return found.stdout
