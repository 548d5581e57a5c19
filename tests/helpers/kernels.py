"""The same code on several kernels of the linear algebra library, each in a process of its own.

OpenBLAS chooses its kernels by the processor, or by OPENBLAS_CORETYPE; a name that it does not know is ignored, and a
kernel whose instructions the processor lacks ends the process with SIGILL.
"""

import os
import signal
import subprocess
import sys

import pytest
from threadpoolctl import threadpool_info

KERNELS = {"Prescott": {"Prescott", "Katmai"}, "Haswell": {"Haswell", "Zen"}, "SkylakeX": {"SkylakeX", "Cooperlake"}}
PROBE = """
import numpy, scipy.linalg, threadpoolctl
for library in (numpy.linalg, scipy.linalg):
    library.eigh(numpy.full((70, 70), 0.1) @ numpy.full((70, 70), 0.2))
found = {{info["architecture"] for info in threadpoolctl.threadpool_info() if info["user_api"] == "blas"}}
if not found or found - {kernels}:
    raise SystemExit({missing})
"""
MISSING = 77  # exit code of a process that runs on another kernel


def output_on(kernel: str, code: str) -> str:
    """What ``code`` prints on a kernel; the test is skipped where the processor does not have it."""
    own = {info["architecture"] for info in threadpool_info() if info["user_api"] == "blas"}
    if own and own <= KERNELS[kernel]:
        pytest.skip(f"the tests themselves run on the kernel {kernel}")
    environment = {**os.environ, "OPENBLAS_CORETYPE": kernel, "PYTHONPATH": os.pathsep.join(sys.path)}
    program = PROBE.format(kernels=KERNELS[kernel], missing=MISSING) + code
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False, env=environment)
    if run.returncode in (MISSING, -signal.SIGILL):
        pytest.skip(f"the processor, or the linear algebra library, has no kernel {kernel}")
    assert run.returncode == 0, run.stderr
    return run.stdout
