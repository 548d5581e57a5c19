"""A structure from the files of other programs: Abaqus, MATLAB, Harwell-Boeing; and by its modes alone.

The files are written here, of a cantilever that strikes a stop at half its length. Every route is to give the same
answer, and modes alone are to show what they leave out.

Run: python examples/structures_from_files.py
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import scipy.io
import scipy.linalg
import scipy.sparse

import multiphi_exudyn as mp

LENGTH, ELEMENTS, FIRST_NODE = 0.5, 20, 101  # m; nodes are numbered from 101 at the clamp
STEEL = {"youngs_modulus": 2.1e11, "density": 7850.0}  # Pa, kg/m3
NODE_OF = {"stop": FIRST_NODE + ELEMENTS // 2, "tip": FIRST_NODE + ELEMENTS}
T_END, PULL, KEPT = 0.1, 20.0, 3  # s, N, modes of the modal routes
DAMPING = 0.01  # of critical, all modes


def free_beam() -> mp.LinearStructure:
    """The beam as a program writes it: with all its nodes, two components each, and no supports."""
    section = mp.Section.rectangle(0.0, LENGTH, width=0.03, height=0.004, **STEEL)
    soft = mp.Clamp(translation=1e-9, rotation=1e-9)
    return mp.planar_beam(mp.Beam([section], {"tip": LENGTH}, clamp=soft), ELEMENTS)


def rows() -> list[tuple[int, str]]:
    """Node and component of every row of the matrices."""
    return [(FIRST_NODE + i, component) for i in range(ELEMENTS + 1) for component in ("uz", "ry")]


def write_abaqus(path: Path, matrix: np.ndarray) -> Path:
    """As *MATRIX OUTPUT, FORMAT=MATRIX INPUT does: node, component, node, component, value of one triangle."""
    number = {"uz": 3, "ry": 5}
    own = [f"{node},{number[component]}" for node, component in rows()]
    lines = [f"{own[i]}, {own[j]}, {matrix[i, j]:.15e}" for i, j in np.argwhere(np.tril(matrix)).tolist()]
    path.write_text("\n".join(lines) + "\n")
    return path


def structures(folder: Path) -> Iterator[tuple[str, mp.LinearStructure]]:
    """The same cantilever by several routes, clamped at its first node."""
    beam = free_beam()
    points = {name: (node, "uz") for name, node in NODE_OF.items()}
    given = {"damping": mp.ModalDamping(DAMPING), "points": points, "fixed": [(FIRST_NODE, "all")]}
    files = write_abaqus(folder / "job_MASS1.mtx", beam.mass), write_abaqus(folder / "job_STIF1.mtx", beam.stiffness)
    whole = mp.read_structure(*files, **given)
    yield "Abaqus, MATRIX INPUT", whole
    scipy.io.savemat(folder / "beam.mat", {"M": beam.mass, "K": scipy.sparse.csc_array(beam.stiffness)})
    yield "MATLAB", mp.read_structure(folder / "beam.mat", folder / "beam.mat", dofs=rows(), **given)
    for name, matrix in (("m.hb", beam.mass), ("k.hb", beam.stiffness)):
        scipy.io.hb_write(folder / name, scipy.sparse.csc_matrix(matrix))
    yield "Harwell-Boeing", mp.read_structure(folder / "m.hb", folder / "k.hb", dofs=rows(), **given)
    for what, known in ((f"{KEPT} modes", ()), (f"{KEPT} modes, flexibility", ("stop", "tip"))):
        yield what, modes_of(whole, known)


def modes_of(whole: mp.LinearStructure, known: tuple[str, ...]) -> mp.LinearStructure:
    """What a modal test, or a list of modes, says of the structure; and the static flexibility of known points."""
    mass, stiffness = whole.mass.toarray(), whole.stiffness.toarray()
    squares, shapes = scipy.linalg.eigh(stiffness, mass, subset_by_index=[0, KEPT - 1])
    flexibility = {name: whole.row(name) @ np.linalg.solve(stiffness, whole.row(name)) for name in known}
    at_points = {name: whole.row(name) @ shapes for name in NODE_OF}
    return mp.structure_from_modes(np.sqrt(squares) / (2 * np.pi), at_points, None, DAMPING, flexibility)


def run(structure: mp.LinearStructure) -> mp.Trajectory:
    """The tip is pulled up, let go, and the beam strikes a stop."""
    model = mp.MultiPhiModel(structure, [mp.UnilateralContact("stop", "stop", gap=1e-3, stiffness=1e6)], modes="all")
    return mp.simulate(model, T_END, displacement=model.static_equilibrium({"tip": PULL}))


def main() -> dict[str, tuple[float, float]]:
    """Difference of the tip to the first route, and the largest contact force [N], of every route."""
    t = np.linspace(0.0, T_END, 4001)
    found: dict[str, tuple[float, float]] = {}
    first = None
    with tempfile.TemporaryDirectory() as folder:
        for name, structure in structures(Path(folder)):
            trajectory = run(structure)
            tip, force = trajectory.at("tip", t), trajectory.contact_force("stop", t)
            first = tip if first is None else first
            found[name] = float(np.linalg.norm(tip - first) / np.linalg.norm(first)), float(np.max(force))
            print(f"{name:22} n = {structure.n:2}  tip {found[name][0]:8.1e}  largest force {found[name][1]:6.1f} N")
            for warning in trajectory.warnings:
                print(f"  {warning}")
    free = mp.MultiPhiModel(free_beam())
    x = free.static_equilibrium({"tip": PULL}, inertia_relief=True)
    print(f"thrown by {PULL:g} N at its free tip it bends by {1e3 * (free.structure.row('tip') @ x):.3f} mm there")
    return found


if __name__ == "__main__":
    main()
