"""A meshed cantilever that strikes a stop, beside the same structure as a Timoshenko beam.

A plate in plane stress, L = 0.5 m, h = 20 mm, meshed and assembled by scikit-fem with quadratic elements (linear ones
lock in bending), M and K sparse. Stop and tip are pieces of its boundary, 20 mm of the lower edge and the end face: a
point of a plate has no finite flexibility, the mean over a piece has. The tip is pulled up 3 mm and let go.

Run: python examples/meshed_cantilever.py [--full] [FIGURE.png]   --full: up to 10^5 degrees of freedom, half a minute
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass

import matplotlib.figure
import numpy as np
import skfem
from matplotlib.collections import PolyCollection
from matplotlib.patches import Rectangle
from skfem.helpers import ddot, dot, eye, sym_grad, trace

import multiphi_exudyn as mp

LENGTH, HEIGHT, WIDTH = 0.5, 0.02, 0.01  # m
YOUNG, POISSON, DENSITY = 2.1e11, 0.3, 7850.0  # Pa, -, kg/m3
STOP_AT, STOP_HALF = 0.4, 0.01  # m: the stop touches the lower edge from 0.39 to 0.41
GAP, STIFFNESS, PULLED = 0.5e-3, 1e6, 3e-3  # m, N/m, m
DAMPING = mp.ModalDamping([], beyond=0.005)
CUT_OFF, END = 8e3, 0.06  # Hz: the modes kept, plate and beam alike; s
TIME = np.linspace(0, END, 6001)
QUICK = ((50, 1), (50, 2))  # elements along and across; 50 k along, so that the stop ends at nodes
EXAGGERATED = 20  # displacements in the picture
FULL = (*QUICK, (150, 8), (600, 20))


@dataclass(frozen=True)
class Plate:
    """The meshed structure; free: which of the basis' degrees of freedom it keeps."""

    structure: mp.LinearStructure
    basis: skfem.Basis
    free: np.ndarray

    def corners(self, configuration: np.ndarray) -> np.ndarray:
        """Corners of every element [mm], displaced and so drawn EXAGGERATED, (elements, 4, 2)."""
        moved = np.zeros(self.basis.N)
        moved[self.free] = configuration
        places = self.basis.mesh.p + EXAGGERATED * moved[self.basis.nodal_dofs]
        return 1e3 * places.T[self.basis.mesh.t.T]


@dataclass(frozen=True)
class Run:
    """One run: histories of the tip [m] and of the contact force [N] at TIME, and its CPU times [s].

    plate: None for the beam. assembly, modes, online: M and K, the base of all levels, the run.
    """

    trajectory: mp.Trajectory
    tip: np.ndarray
    force: np.ndarray
    assembly: float
    modes: float
    online: float
    plate: Plate | None = None

    @property
    def bending(self) -> np.ndarray:
        """First three natural frequencies [Hz] of the open structure; the first longitudinal one is the fifth."""
        return self.trajectory.model.level(()).frequencies[:3]


@skfem.BilinearForm
def strain_energy(u: skfem.DiscreteField, v: skfem.DiscreteField, _: object) -> np.ndarray:
    """Plane stress."""
    first, shear = YOUNG * POISSON / (1 - POISSON**2), YOUNG / (2 * (1 + POISSON))
    strain = sym_grad(u)
    return WIDTH * ddot(first * eye(trace(strain), 2) + 2 * shear * strain, sym_grad(v))


@skfem.BilinearForm
def inertia(u: skfem.DiscreteField, v: skfem.DiscreteField, _: object) -> np.ndarray:
    """Consistent mass."""
    return WIDTH * DENSITY * dot(u, v)


@skfem.LinearForm
def deflection(v: skfem.DiscreteField, _: object) -> np.ndarray:
    """Integral of the deflection."""
    return v[1]


def plate(along: int, across: int) -> Plate:
    """The plate clamped at x = 0; its points are the mean deflections [m] over the stop's piece and the end face."""
    grid = np.linspace(0, LENGTH, along + 1), np.linspace(-HEIGHT / 2, HEIGHT / 2, across + 1)
    mesh = skfem.MeshQuad.init_tensor(*grid).with_boundaries(
        {
            "clamp": lambda x: np.isclose(x[0], 0),
            "stop": lambda x: np.isclose(x[1], -HEIGHT / 2) & (np.abs(x[0] - STOP_AT) < STOP_HALF),
            "tip": lambda x: np.isclose(x[0], LENGTH),
        }
    )
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementQuad2()))
    held = basis.get_dofs("clamp").all()
    free = np.setdiff1d(np.arange(basis.N), held)
    mass, stiffness = (form.assemble(basis)[free][:, free] for form in (inertia, strain_energy))
    means = {name: deflection.assemble(basis.boundary(name)) for name in ("stop", "tip")}
    points = {name: (mean / mean.sum())[free] for name, mean in means.items()}
    return Plate(mp.LinearStructure(mass, stiffness, DAMPING, points), basis, free)


def beam() -> mp.LinearStructure:
    """The same cantilever as a beam."""
    shape = {"width": WIDTH, "height": HEIGHT, "youngs_modulus": YOUNG, "density": DENSITY, "poisson_ratio": POISSON}
    section = mp.Section.rectangle(0.0, LENGTH, **shape)
    return mp.planar_beam(mp.Beam([section], {"stop": STOP_AT, "tip": LENGTH}), elements=100, damping=DAMPING)


def run(mesh_of: tuple[int, int] | None) -> Run:
    """The tip pulled up and let go; elements along and across, or None for the beam."""
    times = [time.process_time()]
    meshed = None if mesh_of is None else plate(*mesh_of)
    structure = beam() if meshed is None else meshed.structure
    times.append(time.process_time())
    stop = mp.UnilateralContact("stop", "stop", GAP, STIFFNESS)
    model = mp.MultiPhiModel(structure, [stop], modes=mp.UpTo(CUT_OFF, most=20))
    pull = model.static_equilibrium({"tip": 1.0})
    times.append(time.process_time())
    trajectory = mp.simulate(model, END, displacement=pull * PULLED / (structure.row("tip") @ pull))
    times.append(time.process_time())
    tip, force = trajectory.at("tip", TIME), trajectory.contact_force("stop", TIME)
    return Run(trajectory, tip, force, *np.diff(times).tolist(), plate=meshed)


def difference(values: np.ndarray, reference: np.ndarray) -> float:
    """||values - reference|| / ||reference||."""
    return float(np.linalg.norm(values - reference) / np.linalg.norm(reference))


def table(reference: Run, runs: list[Run]) -> list[str]:
    """Every mesh in a line: how far from the beam and from the finest mesh, and what it cost."""
    lines = ["      n   frequencies 1-3 to the beam [%]   tip to the beam   to the finest   force to the beam   CPU"]
    for found in runs:
        shifts = 100 * (found.bending / reference.bending - 1)
        lines.append(
            f"{found.trajectory.model.structure.n:7d}   {shifts[0]:+.3f} {shifts[1]:+.3f} {shifts[2]:+.3f}"
            f"   {difference(found.tip, reference.tip):24.2%}   {difference(found.tip, runs[-1].tip):13.3%}"
            f"   {difference(found.force, reference.force):17.2%}   assembly {found.assembly:.2f} s, modes "
            f"{found.modes:.2f} s, run {1e3 * found.online:.1f} ms, {len(found.trajectory.events)} events"
        )
    return lines


def draw(reference: Run, found: Run, drawn: Run, path: str) -> None:
    """The mesh ``drawn`` as it is let go and pressed hardest; tip and contact force of ``found`` and of the beam."""
    figure = matplotlib.figure.Figure(figsize=(9, 8), layout="constrained")
    picture, tip, force = figure.subplots(3, 1, height_ratios=[1.25, 1, 1])
    _mesh(picture, drawn)
    for axis, name, scale in ((tip, "tip", 1e3), (force, "force", 1.0)):
        axis.plot(1e3 * TIME, scale * getattr(found, name), color="#0072B2", lw=2.2, label=_label(found))
        axis.plot(1e3 * TIME, scale * getattr(reference, name), color="#E69F00", lw=1, label="Timoshenko beam")
        axis.set(xlim=(0, 1e3 * END), xlabel="time [ms]")
        axis.grid(color="#EEEEEE")
    tip.set(ylabel="tip [mm]")
    tip.legend(frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    force.set(ylabel="contact force [N]")
    for axis in (picture, tip, force):
        axis.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=100)


def _label(found: Run) -> str:
    return f"mesh, n = {found.trajectory.model.structure.n}"


def _mesh(axis: matplotlib.axes.Axes, drawn: Run) -> None:
    assert drawn.plate is not None, "a beam has no mesh to draw"
    pressed = TIME[np.argmax(drawn.force)]
    moments = ((0.0, "#D55E00", "let go"), (pressed, "#0072B2", f"pressed hardest, at {1e3 * pressed:.1f} ms"))
    for t, colour, label in moments:
        corners = drawn.plate.corners(drawn.trajectory.displacement(t))
        look = {"facecolor": colour + "30", "edgecolor": colour, "lw": 0.5, "label": label}
        axis.add_collection(PolyCollection(corners, **look))
    left, top = 1e3 * (STOP_AT - STOP_HALF), 1e3 * (-HEIGHT / 2 - EXAGGERATED * GAP)
    axis.add_patch(Rectangle((left, top - 12), 2e3 * STOP_HALF, 12, color="0.35"))
    yielded = 1e3 * np.max(drawn.force) / STIFFNESS
    told = f"stop, {1e3 * GAP:g} mm below the beam at rest, yields by {yielded:.2f} mm"
    axis.text(left - 6, top - 26, told, ha="right", va="center", color="0.35")
    axis.set(aspect="equal", xlim=(-5, 1e3 * LENGTH + 5), ylim=(top - 34, 80), xlabel="x [mm]", ylabel="z [mm]")
    axis.set_title(f"{_label(drawn)}, displacements {EXAGGERATED} times as large", fontsize=10)
    axis.legend(frameon=False, loc="upper left")


def main(arguments: list[str]) -> tuple[Run, list[Run]]:
    """The beam, and the plate with finer and finer meshes."""
    paths = [given for given in arguments if not given.startswith("--")]
    reference, runs = run(None), [run(mesh) for mesh in (FULL if "--full" in arguments else QUICK)]
    print(*table(reference, runs), sep="\n")
    if paths:
        draw(reference, runs[-1], runs[len(QUICK) - 1], paths[0])
    return reference, runs


if __name__ == "__main__":
    main(sys.argv[1:])
