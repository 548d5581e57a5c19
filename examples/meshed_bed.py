"""A meshed strip over a bed of 100 stops: what an event costs does not depend on the mesh.

The plate of meshed_cantilever.py with n = 10^3, 10^4 and 10^5 degrees of freedom, and 100 stops below nodes that all
three meshes have. Levels live in a base whose size is that of the modes and contacts asked for; n is in the base alone,
once, and in a run's first and last state. Every mesh is run several times in turn, and the shortest CPU time counts:
another program on the machine can only lengthen it. For runs that build their levels the number of modes goes up by one
from run to run, and the mean counts.

Run: python examples/meshed_bed.py [--full]        --full: the finest mesh too, a minute or two, 1.7 GB
"""

from __future__ import annotations

import dataclasses
import sys
import time

import numpy as np
import skfem
from meshed_cantilever import HEIGHT, LENGTH, inertia, strain_energy

import multiphi_exudyn as mp
from multiphi_exudyn.time.simulate import Run

STOPS = 100
GAP, STIFFNESS, LIFT = 1e-4, 3e4, 2e-3  # m, N/m of one stop, m of the tip at the start
DAMPING = mp.RayleighDamping(0.5, 1e-7)
MODES, END = 24, 0.012  # of every level; s
REPEATS = 5
QUICK = ((50, 2), (150, 8))  # elements along and across, quadratic: nodes at every hundredth of the length
FULL = (*QUICK, (600, 20))


@dataclasses.dataclass(frozen=True)
class Cost:
    """What one mesh costs, CPU times [s].

    size: coordinates of the base. offline: base and open level. start: the first state of a run, the shortest. new: an
    event of a run that builds its levels. known: an event of a run with known levels. events: of the latter.
    """

    n: int
    size: int
    offline: float
    start: float
    new: float
    known: float
    events: int


def strip(along: int, across: int, stops: int = STOPS) -> mp.LinearStructure:
    """The plate clamped at x = 0, with points below it at every stop, the last one below the tip."""
    grid = np.linspace(0, LENGTH, along + 1), np.linspace(-HEIGHT / 2, HEIGHT / 2, across + 1)
    basis = skfem.Basis(skfem.MeshQuad.init_tensor(*grid), skfem.ElementVector(skfem.ElementQuad2()))
    x, y = basis.doflocs
    free = np.setdiff1d(np.arange(basis.N), basis.get_dofs(lambda place: np.isclose(place[0], 0)).all())
    mass, stiffness = (form.assemble(basis)[free][:, free] for form in (inertia, strain_energy))
    below = np.flatnonzero(np.isclose(y[free], -HEIGHT / 2) & (_component(basis)[free] == 1))
    places = {f"p{i}": _one(below[np.isclose(x[free][below], LENGTH * (i + 1) / stops)]) for i in range(stops)}
    return mp.LinearStructure(mass, stiffness, DAMPING, places)


def _component(basis: skfem.Basis) -> np.ndarray:
    """0 for a displacement along x, 1 for one along y, (N,)."""
    component = np.zeros(basis.N, int)
    for dofs in (basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs):
        component[dofs[1]] = 1
    return component


def _one(found: np.ndarray) -> int:
    (dof,) = found.tolist()
    return int(dof)


@dataclasses.dataclass(frozen=True)
class Timed:
    """CPU times [s] of a run's first state and of its motion, and the number of its events."""

    start: float
    motion: float
    events: int


class Bed:
    """One mesh over the stops, its base built, at the start of its runs."""

    def __init__(self, mesh: tuple[int, int], stops: int = STOPS) -> None:
        structure = strip(*mesh, stops)
        contacts = [mp.UnilateralContact(f"stop {i}", f"p{i}", GAP, STIFFNESS) for i in range(stops)]
        started = time.process_time()
        most = mp.MultiPhiModel(structure, contacts, modes=MODES + REPEATS)
        base, tip = most.base, f"p{stops - 1}"
        self.model = dataclasses.replace(most, modes=MODES)
        bent = base.modes.shapes @ (self.model.base_load({tip: 1.0}) / base.modes.omega**2)
        self.start = LIFT / (structure.row(tip) @ bent) * bent
        self.model.level(())
        self.offline = time.process_time() - started
        self.first: list[Timed] = []
        self.again: list[Timed] = []

    def run(self, t_end: float) -> None:
        """One more run with levels that are built for it, and one with known ones."""
        model = dataclasses.replace(self.model, modes=MODES + 1 + len(self.first))
        self.first.append(self._timed(model, t_end))
        if not self.again:
            self._timed(self.model, t_end)
        self.again.append(self._timed(self.model, t_end))

    def _timed(self, model: mp.MultiPhiModel, t_end: float) -> Timed:
        times = [time.process_time()]
        motion = Run(model, t_end, self.start).begun()
        times.append(time.process_time())
        motion.advance(t_end)
        times.append(time.process_time())
        assert not motion.message, motion.message
        return Timed(*np.diff(times).tolist(), events=len(motion.trajectory(t_end).events))

    @property
    def cost(self) -> Cost:
        """Of all runs so far."""
        return Cost(
            n=self.model.structure.n,
            size=self.model.base.modes.count,
            offline=self.offline,
            start=min(run.start for run in self.again),
            new=sum(run.motion for run in self.first) / sum(run.events for run in self.first),
            known=min(run.motion for run in self.again) / self.again[0].events,
            events=self.again[0].events,
        )


def main(arguments: list[str], stops: int = STOPS, t_end: float = END, repeats: int = REPEATS) -> list[Cost]:
    """Builds every mesh, runs them in turn, and prints what an event costs."""
    beds = [Bed(mesh, stops) for mesh in (FULL if "--full" in arguments else QUICK)]
    for _ in range(repeats):
        for bed in beds:
            bed.run(t_end)
    costs = [bed.cost for bed in beds]
    for cost in costs:
        print(
            f"n = {cost.n:6d}: base {cost.size}, offline {cost.offline:.1f} s, start {1e3 * cost.start:.1f} ms, "
            f"{cost.events} events, each {1e3 * cost.new:.2f} ms while levels are built, {1e3 * cost.known:.2f} ms then"
        )
    for name in ("new", "known"):
        times = [getattr(cost, name) for cost in costs]
        print(f"levels {name}: the finest mesh to the coarsest {times[-1] / times[0]:.2f}")
    return costs


if __name__ == "__main__":
    main(sys.argv[1:])
