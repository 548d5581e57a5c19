"""What only POSIX has, or numba, is not needed on the main path: importing, simulating, pictures, the command line."""

import subprocess
import sys

import numpy as np
from posix_modules import POSIX

from multiphi_exudyn import cli

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
tr = mp.simulate(model, 0.05, displacement=model.static_equilibrium({{"tip": 50.0}}), compiled=False)
tr.plot(["tip"])
tr.save("run.npz")
assert mp.load_trajectory("run.npz").events == tr.events
print(len(tr.events), main(["new", "scene"]), main(["validate", "scene.toml"]))
"""


def test_nothing_that_only_posix_has_is_needed_on_the_main_path(tmp_path):
    assert cli.main(["compile"]) == 0  # ahead, which is announced
    told = subprocess.run([sys.executable, "-c", MAIN_PATH], capture_output=True, text=True, cwd=tmp_path)
    assert told.stderr == ""
    events, *codes = told.stdout.splitlines()[-1].split()
    assert int(events) >= 2
    assert codes == ["0", "0"]


def test_a_process_without_numba_finds_the_same_run():
    code = """
import importlib.util
import numpy as np
import multiphi_exudyn as mp

if {blocked}:
    found = importlib.util.find_spec
    importlib.util.find_spec = lambda name, *more: None if name == "numba" else found(name, *more)
K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])
chain = mp.LinearStructure(np.eye(3), K, mp.RayleighDamping(0.1, 1e-4), {{"tip": 2, "mid": 1}})
contacts = [mp.UnilateralContact("stop", "tip", 1e-3, 1e6), mp.UnilateralContact("wall", "mid", 1e-3, float("inf"))]
model = mp.MultiPhiModel(chain, [*contacts, mp.Friction("ring", "mid", 5.0)])
run = mp.simulate(model, 0.1, displacement=[0.0, 0.0, -5e-3])
print(len(run.events), *(event.time for event in run.events), run.ledger.friction)
"""
    runs = [
        subprocess.run([sys.executable, "-c", code.format(blocked=each)], capture_output=True, text=True, check=True)
        for each in (False, True)
    ]
    compiled_run, plain_run = (np.array(run.stdout.split(), float) for run in runs)
    np.testing.assert_allclose(plain_run, compiled_run, rtol=1e-9)
    assert compiled_run[0] > 5
