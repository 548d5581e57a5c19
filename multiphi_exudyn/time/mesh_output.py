"""Mesh output: a motion on the mesh of its structure, as VTU files that ParaView opens.

At every node: displacement [m], velocity [m/s] and the force of contacts, friction and force laws [N], the sum of
h lambda and -h_t T over the elements of the model.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse

from multiphi_exudyn.errors import MultiPhiError, MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.arguments import real_array
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.structure import LinearStructure
from multiphi_exudyn.time.histories import Histories

__all__ = ["contact_forces", "write_vtu"]

COMPONENTS = 3  # of a vector in a VTU file
COLLECTION = """<?xml version="1.0"?>
<VTKFile type="Collection" version="0.1"><Collection>
{}
</Collection></VTKFile>
"""


def write_vtu(
    motion: Histories, model: MultiPhiModel, path: str | Path, mesh: Any, dofs: np.ndarray, times: np.ndarray
) -> list[Path]:
    """Write a motion of a model at times (k,) [s]; the others are those of ``Trajectory.to_vtu``."""
    meshio, target = _meshio(), Path(path)
    if target.suffix != ".pvd":
        raise MultiPhiValueError(f"path: got {str(path)!r}, need a name that ends with .pvd")
    drawn = _as_mesh(meshio, mesh)
    places = _places(model.structure, dofs, len(drawn.points))
    moved, speeds = motion.displacement(times), motion.velocity(times)
    forces, files, listed = contact_forces(motion, model, times), list[Path](), list[str]()
    for k, t in enumerate(times.tolist()):
        file = target.with_name(f"{target.stem}_{k:0{len(str(len(times)))}d}.vtu")
        fields = {"displacement": moved, "velocity": speeds, "contact force": forces}
        data = {name: _at_nodes(values[:, k], places) for name, values in fields.items()}
        meshio.Mesh(drawn.points, drawn.cells, point_data=data).write(file)
        files.append(file)
        listed.append(f'<DataSet timestep="{t!r}" file="{file.name}"/>')
    target.write_text(COLLECTION.format("\n".join(listed)), encoding="utf-8")
    return [target, *files]


def contact_forces(motion: Histories, model: MultiPhiModel, times: np.ndarray) -> np.ndarray:
    """Forces (n, k) [N] that all contacts, frictions and force laws exert on the structure at times (k,)."""
    rows, forces = list[np.ndarray](), list[Any]()
    for element in model.contacts:
        if not isinstance(element, Friction):
            rows.append(model.structure.row(element.direction))
            forces.append(motion.contact_force(element.name, times))
        along = element.tangential if isinstance(element, UnilateralContact) else element.direction
        if along is not None and element.name in (*motion.frictions, *motion.rubbing):
            rows.append(-model.structure.row(along))
            forces.append(motion.friction_force(element.name, times))
    if not rows:
        return np.zeros((model.structure.n, len(times)))
    return np.asarray(scipy.sparse.csr_array(np.array(rows)).T @ np.array(forces))


def _meshio() -> Any:
    try:
        import meshio
    except ImportError as error:
        raise MultiPhiError("to_vtu needs meshio: pip install 'multiphi-exudyn[mesh]'") from error
    return meshio


def _as_mesh(meshio: Any, mesh: Any) -> Any:
    """A mesh with three coordinates a node; of coordinates alone a vertex for each."""
    cells = None if isinstance(mesh, np.ndarray) else getattr(mesh, "cells", None)
    points = real_array("mesh", mesh if cells is None else mesh.points, "a meshio.Mesh, or coordinates (p, 1 to 3)")
    if points.ndim != 2 or not 1 <= points.shape[1] <= COMPONENTS:
        raise MultiPhiValueError(f"mesh: got coordinates of shape {points.shape}, need (p, 1 to 3)")
    vertices = [("vertex", np.arange(len(points))[:, None])]
    padded = np.pad(points, ((0, 0), (0, COMPONENTS - points.shape[1])))
    return meshio.Mesh(padded, vertices if cells is None else cells)


def _places(structure: LinearStructure, dofs: Any, nodes: int) -> np.ndarray:
    """Rows (p, 3) of x that hold the displacements of the nodes, n where there are none.

    dofs: (p, d) in the numbering without supports, -1 for none.
    """
    given = np.asarray(dofs)
    if given.dtype.kind not in "iu":
        raise MultiPhiTypeError("dofs: need an array of whole numbers, a row for each node")
    if given.ndim != 2 or given.shape[0] != nodes or not 1 <= given.shape[1] <= COMPONENTS:
        raise MultiPhiValueError(
            f"dofs: got shape {given.shape}, need ({nodes}, 1 to 3): a row for each node of the mesh"
        )
    rows = np.full(max(int(given.max()), int(structure.free.max())) + 2, structure.n)
    rows[structure.free] = np.arange(structure.n)
    return np.pad(rows[given], ((0, 0), (0, COMPONENTS - given.shape[1])), constant_values=structure.n)


def _at_nodes(values: np.ndarray, places: np.ndarray) -> np.ndarray:
    return np.append(values, 0.0)[places]
