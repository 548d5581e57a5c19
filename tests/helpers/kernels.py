"""The same code on several kernels of the linear algebra library, each in a process of its own.

OpenBLAS chooses its kernels by the processor, or by OPENBLAS_CORETYPE; a name that it does not know is ignored, and a
kernel whose instructions the processor lacks ends the process with SIGILL.
"""

import functools
import os
import signal
import subprocess
import sys

import pytest

KERNELS = {"Prescott": {"Prescott", "Katmai"}, "Haswell": {"Haswell", "Zen"}, "SkylakeX": {"SkylakeX", "Cooperlake"}}
PROBE = (
    "import numpy, scipy.linalg, threadpoolctl\n"
    "for library in (numpy.linalg, scipy.linalg):\n"
    "    library.eigh(numpy.full((70, 70), 0.1) @ numpy.full((70, 70), 0.2))\n"
    "print(*{info['architecture'] for info in threadpoolctl.threadpool_info() if info['user_api'] == 'blas'})\n"
)


def output_on(kernel: str, code: str) -> str:
    """What ``code`` prints on a kernel; the test is skipped where the processor does not have it."""
    if available(kernel) not in KERNELS[kernel]:
        pytest.skip(f"the processor, or the linear algebra library, has no kernel {kernel}")
    run = _run(kernel, code)
    assert run.returncode == 0, run.stderr
    return run.stdout


@functools.cache
def available(kernel: str) -> str:
    """The kernel that runs where this one is asked for; "" where the processor lacks its instructions."""
    run = _run(kernel, PROBE)
    assert run.returncode in (0, -signal.SIGILL), run.stderr
    return run.stdout.strip()


def _run(kernel: str, code: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "OPENBLAS_CORETYPE": kernel, "PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, env=environment)
