"""Needs: resources that the reduced run of a scene uses.

Levels built of levels possible, modal coordinates of DoFs, packages imported, memory. The run starts from M, C, K and
the contacts in a new process, so that what this process has loaded does not count.
"""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.mechanics.structure import LinearStructure
from multiphi_exudyn.study.model_kinds import ReducedModel
from multiphi_exudyn.study.scene import Scene
from multiphi_exudyn.study.setup import prepare, start_configuration

__all__ = ["Needs", "needs_of", "needs_table"]

RUN_ALONE = "multiphi_exudyn.study.run_alone"
HEADS = ("scene", "model", "levels built", "coordinates", "peak memory", "modules", "packages imported")


@dataclass(frozen=True)
class Needs:
    """Resources used by the reduced run of a scene.

    levels_built of levels_possible; dofs_carried: coordinates of the largest level visited, those of varying loads
    among them, of dofs_given. modules: of this package, packages: others beside the standard library, that the run
    imported. memory: its peak [bytes], M and K themselves not counted. warnings: those of the run.
    """

    scene: str
    model: str
    status: str
    levels_built: int
    levels_possible: int
    dofs_carried: int
    dofs_given: int
    modules: int
    packages: tuple[str, ...]
    memory: int
    warnings: tuple[str, ...]


def needs_of(scene: Scene) -> Needs:
    """Run the first reduced model of a scene in a new process, and return what it used."""
    spec = next((s for s in scene.models.values() if isinstance(s, ReducedModel) and s.tolerance is None), None)
    if spec is None:
        raise MultiPhiValueError(f"{scene.path}: models: got none of kind 'reduced' with a number of modes, need one")
    setup = prepare(scene)
    model, structure = setup.model(spec), setup.structure
    model_arguments = {
        "structure": LinearStructure(structure.mass, structure.stiffness, structure.damping, structure.points),
        "contacts": setup.nonlinearities(spec.rigid),
        "modes": model.modes,
        "overrides": setup.overrides,
    }
    run_arguments = {"t_end": setup.t_end, "displacement": start_configuration(setup, model), "loads": setup.loads}
    values = json.loads(_run_in_process(pickle.dumps((model_arguments, run_arguments))))
    tuples = {name: tuple(values[name]) for name in ("packages", "warnings")}
    return Needs(scene=scene.name, model=spec.name, **values | tuples)


def needs_table(needs_of_scenes: Sequence[Needs]) -> str:
    """Text table with a line for each scene."""
    rows = [HEADS, *(_cells(needs) for needs in needs_of_scenes)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEADS))]
    return "\n".join("  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)) for row in rows)


def _run_in_process(task: bytes) -> str:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "task"
        file.write_bytes(task)
        command = [sys.executable, "-m", RUN_ALONE, str(file)]
        process = subprocess.run(command, capture_output=True, text=True, env=os.environ, check=False)
    if process.returncode:
        raise NumericalFailure(f"the run in a process of its own ended with {process.stderr.strip().splitlines()[-1]}")
    return process.stdout


def _cells(needs: Needs) -> tuple[str, ...]:
    possible = str(needs.levels_possible) if needs.levels_possible < 1e6 else f"{needs.levels_possible:.0e}"
    return (
        needs.scene,
        needs.model,
        f"{needs.levels_built} of {possible}",
        f"{needs.dofs_carried} of {needs.dofs_given}",
        f"{needs.memory / 1e6:.1f} MB",
        str(needs.modules),
        ", ".join(needs.packages),
    )
