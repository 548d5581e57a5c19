"""A plate above hundreds of stops: own modes for every set of closed stops, or one basis and a residual boundary.

A solid cantilever plate, 1 m x 0.2 m x 20 mm, of hexahedra, with stops 0.05 to 0.15 mm below nodes of its lower face.
The tip is pressed down with 100 N and let go, and the plate slaps down on many stops at a time. Hardly a set of closed
stops occurs twice, so that most of the work is that of new levels: with own modes each is an eigenproblem in the base,
on a residual boundary an r x r one. The motion is written for ParaView, with the forces of the stops.

Run: python examples/plate_on_many_stops.py [--full] [FILE.pvd]   --full: n = 12393, 200 stops, half a minute
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass

import numpy as np
import skfem
from skfem.helpers import dot
from skfem.io.meshio import to_meshio
from skfem.models.elasticity import lame_parameters, linear_elasticity

import multiphi_exudyn as mp

SIZE = (1.0, 0.2, 0.02)  # m
YOUNG, POISSON, DENSITY = 2.1e11, 0.3, 7850.0  # Pa, -, kg/m3
STIFFNESS, PRESSED, END = 1e6, 100.0, 0.1  # N/m of a stop, N, s
QUICK, FULL = ((20, 5, 2), 60), ((80, 16, 2), 200)  # elements, stops
MODES = 15


@dataclass(frozen=True)
class Cost:
    """A run, and its CPU times [s]: the base with the start, the first run, and one from another start."""

    trajectory: mp.Trajectory
    base: float
    first: float
    other: float


def plate(elements: tuple[int, int, int], stops: int) -> tuple[mp.LinearStructure, list[str], skfem.Basis]:
    """The plate clamped at x = 0, the names of its points above stops, and its basis."""
    mesh = skfem.MeshHex.init_tensor(*(np.linspace(0, size, n + 1) for size, n in zip(SIZE, elements, strict=True)))
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementHex1()), intorder=2)
    stiffness = skfem.asm(linear_elasticity(*lame_parameters(YOUNG, POISSON)), basis)
    mass = skfem.asm(skfem.BilinearForm(lambda u, v, _: DENSITY * dot(u, v)), basis)
    below = np.flatnonzero((mesh.p[2] < 1e-9) & (mesh.p[0] > 0.05))
    chosen = np.random.default_rng(1).choice(below, stops, replace=False)
    vertical = {f"p{i}": int(basis.nodal_dofs[2, node]) for i, node in enumerate(chosen)}
    tip = int(np.argmin(np.abs(mesh.p - np.array([[SIZE[0]], [SIZE[1] / 2], [SIZE[2]]])).sum(axis=0)))
    clamped = basis.nodal_dofs[:, mesh.p[0] < 1e-9].ravel().tolist()
    points = {"tip": int(basis.nodal_dofs[2, tip]), **vertical}
    structure = mp.LinearStructure(mass, stiffness, mp.ModalDamping(0.01), points, fixed=clamped)
    return structure, list(vertical), basis


def run(structure: mp.LinearStructure, places: list[str], boundary: str) -> Cost:
    """The tip let go from -100 N, and a second time from -90 N."""
    gaps = 1e-4 * (0.5 + np.random.default_rng(2).random(len(places)))
    stops = [mp.UnilateralContact(f"stop {p}", p, float(g), STIFFNESS) for p, g in zip(places, gaps, strict=True)]
    model = mp.MultiPhiModel(structure, stops, modes=MODES, boundary=boundary)
    clock = [time.process_time()]
    starts = [model.static_equilibrium({"tip": -force}) for force in (PRESSED, 0.9 * PRESSED)]
    clock.append(time.process_time())
    trajectory = mp.simulate(model, END, displacement=starts[0])
    clock.append(time.process_time())
    mp.simulate(model, END, displacement=starts[1])
    clock.append(time.process_time())
    return Cost(trajectory, *np.diff(clock).tolist())


def main(arguments: list[str]) -> dict[str, Cost]:
    """Both ways, and the files of the second one where a name is given."""
    elements, stops = FULL if "--full" in arguments else QUICK
    structure, places, basis = plate(elements, stops)
    print(f"n = {structure.n}, {stops} stops, r = {MODES}")
    costs = {boundary: run(structure, places, boundary) for boundary in ("own", "residual")}
    for boundary, cost in costs.items():
        print(
            f"{boundary:9s} base {cost.base:6.2f} s, first run {cost.first:6.2f} s, another start {cost.other:6.2f} s; "
            f"{len(cost.trajectory.events)} events, {cost.trajectory.status}"
        )
    times = np.linspace(0, END, 2001)
    tips = [cost.trajectory.at("tip", times) for cost in costs.values()]
    print(f"tip: the two differ by {np.linalg.norm(tips[0] - tips[1]) / np.linalg.norm(tips[0]):.2%}")
    for path in [given for given in arguments if not given.startswith("--")]:
        mesh = to_meshio(basis.mesh)
        files = costs["residual"].trajectory.to_vtu(path, mesh, basis.nodal_dofs.T, np.linspace(0, END, 101))
        print(f"{files[0]} and {len(files) - 1} VTU files, for ParaView")
    return costs


if __name__ == "__main__":
    main(sys.argv[1:])
