"""What only POSIX has is not needed on the main path: importing, simulating, pictures, the command line."""

import subprocess
import sys

from posix_modules import POSIX

MAIN_PATH = f"""
import os, signal, sys, sysconfig
for name in {POSIX}:
    sys.modules[name] = None
for name in ("fork", "forkpty", "getuid", "killpg", "sched_getaffinity"):
    delattr(os, name)
del signal.SIGALRM, signal.SIGIO
import numpy as np
import multiphi_exudyn as mp
sysconfig.get_config_vars()  # of this platform, before it is called another one
sys.platform = "another"
from multiphi_exudyn.cli import main
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody
structure = mp.LinearStructure(np.eye(2), 4e4 * np.array([[2, -1], [-1, 1]]), points={{"tip": 1}})
model = mp.MultiPhiModel(structure, [mp.UnilateralContact("stop", "tip", 1e-3, 1e6)])
tr = mp.simulate(model, 0.05, displacement=model.static_equilibrium({{"tip": 50.0}}))
tr.plot(["tip"])
tr.save("run.npz")
assert mp.load_trajectory("run.npz").events == tr.events
print(len(tr.events), main(["new", "scene"]), main(["validate", "scene.toml"]))
"""


def test_nothing_that_only_posix_has_is_needed_on_the_main_path(tmp_path):
    told = subprocess.run([sys.executable, "-c", MAIN_PATH], capture_output=True, text=True, cwd=tmp_path)
    assert told.stderr == ""
    events, *codes = told.stdout.splitlines()[-1].split()
    assert int(events) >= 2
    assert codes == ["0", "0"]
