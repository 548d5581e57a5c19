"""Cases of beams beside the full nonlinear beam: where the contact is, how stiff, how many modes, how far pulled."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from multiphi_exudyn.mechanics.beam import Beam, PointMass, Section, planar_beam
from multiphi_exudyn.mechanics.structure import LinearStructure
from multiphi_exudyn.study.stability.case import Case, Problem
from multiphi_exudyn.study.stability.structures import differs, pulled, rig_problem, stop
from multiphi_exudyn.time.simulate import simulate
from multiphi_exudyn.time.trajectory import Trajectory
from reference_models.rig import rig_beam, rig_contact

__all__ = ["CASES"]

HIT = 0.09  # s: the rig's tip, pulled up 20 mm, strikes its support at 0.065 s
DENSE = 250  # elements up to which matrices are given dense
PULLED = 0.02  # m: the rig's own displacement
SCALED = 1e-9  # relative: what a linear structure's answer may differ by from another amplitude's
SECOND_NODE = 0.7834  # of the length: where a uniform cantilever's second mode does not move


def _cantilever(points: dict[str, float], masses: tuple[PointMass, ...] = ()) -> Beam:
    """A uniform steel strip 0.5 m long."""
    section = Section.rectangle(
        0.0, 0.5, width=0.02, height=3e-3, youngs_modulus=2.1e11, density=7850.0, poisson_ratio=0.3
    )
    return Beam([section], {"tip": 0.5, **points}, masses)


def _strip(
    x: float, stiffness: float, t_end: float = 0.1, masses: tuple[PointMass, ...] = (), gap: float = 1e-4
) -> Problem:
    """The strip pulled up 10 mm over a stop below x [m]."""
    contact = stop("touching", gap, stiffness)
    beam = _cantilever({"touching": x}, masses)
    return pulled(beam, [contact], t_end, tip="tip", displacement=0.01)


def _rig_on(stiffness: float, quick: bool) -> Problem:
    return rig_problem(stiffness, HIT)


def _rig_with(modes: int, stiffness: float, quick: bool) -> Problem:
    return rig_problem(stiffness, 0.2 if quick else 0.5, modes=modes, penalty=1e6)


def _rig_scaled(displacement: float, quick: bool) -> Problem:
    return rig_problem(1e6, HIT, displacement, gap=rig_contact().gap * displacement / PULLED, modes=12)


def _scales(problem: Problem, trajectory: Trajectory) -> str:
    """The same events as of the rig's own displacement, and the displacement in proportion."""
    own = _rig_scaled(PULLED, True)
    assert problem.pull is not None, "beams are pulled"
    other = simulate(own.model(), own.t_end, own.displacement)
    return differs(trajectory, other, "node3", problem.pull.displacement / PULLED, SCALED)


def _stiffnesses() -> Iterator[Case]:
    for exponent in range(3, 13):
        yield Case(
            f"stiffness-1e{exponent}",
            f"The rig on a support of 1e{exponent} N/m, all modes: one more decade of stiffness.",
            partial(_rig_on, 10.0**exponent),
            quick=exponent in (3, 6, 12),
        )
    yield Case(
        "stiffness-infinite",
        "The rig on a rigid support, all modes: plastic impacts, releases, micro-bounces.",
        lambda quick: rig_problem(math.inf, HIT, penalty=1e7),
    )


def _mode_numbers() -> Iterator[Case]:
    for modes in (1, 2, 4, 8, 16):
        for law, stiffness in (("compliant", 1e6), ("rigid", math.inf)):
            yield Case(
                f"modes-{modes}-{law}",
                f"{modes} of the rig's modes, {law} support: what truncation leaves must be told.",
                partial(_rig_with, modes, stiffness),
                quick=modes in (1, 4),
            )


def _amplitudes() -> Iterator[Case]:
    for metres, text in ((1e-6, "1um"), (1e-3, "1mm"), (0.05, "50mm"), (0.2, "200mm")):
        yield Case(
            f"tip-{text}",
            f"The rig's tip pulled {1e3 * metres:g} mm, the gap in proportion: the reduced answer scales, "
            + ("down to where round-off begins." if metres < 0.01 else "the full beam is no longer linear."),
            partial(_rig_scaled, metres),
            _scales,
            quick=text in ("1um", "200mm"),
        )


def _meshed(elements: int, modes: int | str, quick: bool) -> Problem:
    """The rig as Timoshenko elements, sparse where there are many."""
    given = planar_beam(rig_beam(), elements)
    if elements > DENSE:
        sparse = scipy.sparse.csr_array(given.mass), scipy.sparse.csr_array(given.stiffness)
        given = LinearStructure(*sparse, None, given.points)
    shape = _static(given, "node3")
    start = shape * (0.02 / float(given.row("node3") @ shape))
    return Problem(given, [rig_contact(1e6)], HIT, modes, displacement=start)


def _static(structure: LinearStructure, point: str) -> np.ndarray:
    """x (n,) under 1 N, by the stiffness itself."""
    row = structure.row(point)
    if scipy.sparse.issparse(structure.stiffness):
        return np.asarray(scipy.sparse.linalg.spsolve(scipy.sparse.csc_array(structure.stiffness), row))
    return np.asarray(np.linalg.solve(structure.stiffness, row))


def _meshes() -> Iterator[Case]:
    for elements, modes in ((10, "all"), (50, "all"), (250, 24), (1000, 24), (2000, 24)):
        yield Case(
            f"elements-{elements}",
            f"The rig in {elements} elements, {modes} modes: "
            + ("the highest frequency grows as their square." if modes == "all" else "a sparse eigenproblem."),
            partial(_meshed, elements, modes),
            quick=elements in (10, 1000),
        )


CASES = (
    Case("contact-at-clamp-side-node",
         "The stop stands beside the clamp, where the beam hardly moves: forces are large, travel is microns.",
         lambda quick: _strip(0.0625, 1e8, gap=1e-6)),
    Case("contact-at-tip-mass", "The stop is below a heavy tip mass: the impulse goes into one node.",
         lambda quick: _strip(0.5, 1e6, 0.4, (PointMass(0.5, 1.0, 1e-4),))),
    Case("contact-at-node-of-a-mode",
         "The stop stands where the second mode does not move: closed and open levels share that mode.",
         lambda quick: _strip(0.5 * SECOND_NODE, 1e7)),
    *_stiffnesses(),
    *_meshes(),
    *_mode_numbers(),
    *_amplitudes(),
)  # fmt: skip
