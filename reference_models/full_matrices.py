"""The full model of a structure that is given by matrices: all its coordinates in Exudyn, with contact elements.

    M q'' + C q' + K q = f + sum h_i lambda_i - sum p_j F_j(p_j.q),   lambda_i = k_i max(0, -g_i)

ObjectGenericODE2 holds M, C, K and static loads, its user function force laws (by their segments) and viscous
contacts, lambda_i = max(0, -k_i g_i - c_i g_i') where g_i < 0; ObjectContactCoordinate every other contact; the
trapezoidal rule with a fixed step integrates. No modes, no levels: what is left against a reduced model is time
integration and reduction.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np
import scipy.sparse
from scipy.integrate import cumulative_trapezoid

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.element import AnyLink
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.structure import LinearStructure
from reference_models.exudyn_quiet import cpu_limit, quiet
from reference_models.full_beam_settings import FullBeamSettings
from reference_models.solver_settings import simulation_settings

__all__ = ["MatrixRun", "run_matrices"]

Force = Callable[[float, np.ndarray, np.ndarray], np.ndarray]  # (n,) at t, q, q'

NEWTON = 1e-10  # relative and absolute: linear but for the contacts, an iteration ends at round-off


@dataclass(frozen=True)
class MatrixRun:
    """k samples, one a step: time [s], gaps: contact -> (k,) [m], energy, kinetic, work (k,) [J].

    energy: kinetic, strain, contact springs and force laws; work: of the loads since the start.
    wall_s: of the solver [s].
    """

    time: np.ndarray
    gaps: dict[str, np.ndarray]
    energy: np.ndarray
    kinetic: np.ndarray
    work: np.ndarray
    wall_s: float


def run_matrices(
    structure: LinearStructure,
    contacts: Sequence[UnilateralContact],
    t_end: float,
    steps: int,
    *,
    displacement: np.ndarray | None = None,
    velocity: np.ndarray | None = None,
    load: np.ndarray | None = None,
    varying: Callable[[np.ndarray], np.ndarray] | None = None,
    damping: np.ndarray | None = None,
    laws: Sequence[ForceLaw] = (),
    cpu_limit_s: float | None = None,
) -> MatrixRun:
    """Integrate from x, x' (n,) with ``steps`` equal steps under a static load (n,).

    varying: the load that changes, (n, k) at times (k,) [s], beside the static one.
    damping: C (n, n), in place of the structure's own description of it.
    laws: force laws; their gaps are q less the place of their centres.

    Every contact has a finite stiffness and, unless it is viscous, acts on one coordinate, or between two with opposite
    coefficients.
    Raises MultiPhiValueError for another contact, NumericalFailure where the solver stops early.
    """
    zero = np.zeros(structure.n)
    x, v, f = (zero if given is None else given for given in (displacement, velocity, load))
    with quiet(), cpu_limit(cpu_limit_s):
        container = exu.SystemContainer()  # owns the system
        mbs = container.AddSystem()
        local = _local_forces(structure, contacts, laws)
        elastic = [contact for contact in contacts if not contact.damping]
        sensors = _build(mbs, structure, elastic, (x, v, f), _user_force(varying, local), damping)
        started = time.perf_counter()
        _solve(mbs, t_end, steps, cpu_limit_s)
        wall_s = time.perf_counter() - started
        q, q_t = (np.array(mbs.GetSensorStoredData(sensor)) for sensor in sensors)
    elements: list[AnyLink] = [*contacts, *laws]
    gaps = {link.name: q[:, 1:] @ structure.row(link.direction) + link.gap for link in elements}
    work = (q[:, 1:] - q[0, 1:]) @ f
    if varying is not None:
        power = np.sum(varying(q[:, 0]).T * q_t[:, 1:], axis=1)
        work = work + cumulative_trapezoid(power, q[:, 0], initial=0)
    kinetic = np.sum(q_t[:, 1:] * (structure.mass @ q_t[:, 1:].T).T, axis=1) / 2
    energy = kinetic + _strain(structure, contacts, gaps, q[:, 1:])
    for law in laws:
        energy = energy + law.energy(q[:, 1:] @ structure.row(law.at))
    return MatrixRun(q[:, 0], gaps, energy, kinetic, work, wall_s)


def _local_forces(
    structure: LinearStructure, contacts: Sequence[UnilateralContact], laws: Sequence[ForceLaw]
) -> Force | None:
    """Forces (n,) of force laws and viscous contacts at q, q' (n,); None where there are none."""
    places = [(law, structure.row(law.at)) for law in laws]
    viscous = [(contact, structure.row(contact.direction)) for contact in contacts if contact.damping]

    def force(t: float, q: np.ndarray, q_t: np.ndarray) -> np.ndarray:
        total = np.zeros(structure.n)
        for law, row in places:
            total -= row * float(law.force(row @ q))
        for contact, row in viscous:
            gap = float(row @ q) + contact.gap
            if gap < 0:
                total += row * max(0.0, -contact.stiffness * gap - contact.damping * float(row @ q_t))
        return total

    return force if places or viscous else None


def _user_force(varying: Callable[[np.ndarray], np.ndarray] | None, local: Force | None) -> Force | None:
    """Varying loads and local forces (n,) at t, q, q'; None where there are neither."""
    given: list[Force] = [] if local is None else [local]
    if varying is not None:
        given.append(lambda t, q, q_t: varying(np.array([t]))[:, 0])
    return (lambda t, q, q_t: np.asarray(sum(force(t, q, q_t) for force in given))) if given else None


def _build(
    mbs: Any,
    structure: LinearStructure,
    contacts: Sequence[UnilateralContact],
    given: tuple[np.ndarray, np.ndarray, np.ndarray],
    added: Force | None,
    damping: np.ndarray | None,
) -> list[Any]:
    """Add everything and assemble; the sensors of coordinates and velocities. given: x, x', static load (n,)."""
    n, (displacement, velocity, load) = structure.n, given

    def force(mbs: Any, t: float, item: Any, q: Any, q_t: Any) -> np.ndarray:
        assert added is not None, "set only then"
        return added(t, np.array(q), np.array(q_t))

    options = {"dampingMatrix": None if damping is None else _dense(damping), "forceUserFunction": added and force}
    node = mbs.AddNode(
        eii.NodeGenericODE2(
            referenceCoordinates=np.zeros(n),
            initialCoordinates=displacement,
            initialCoordinates_t=velocity,
            numberOfODE2Coordinates=n,
        )
    )
    mbs.AddObject(
        eii.ObjectGenericODE2(
            nodeNumbers=[node],
            massMatrix=_dense(structure.mass),
            stiffnessMatrix=_dense(structure.stiffness),
            forceVector=load,
            **{name: value for name, value in options.items() if value is not None},
        )
    )
    ground = mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(eii.NodePointGround()), coordinate=0))
    for contact in contacts:
        row = structure.row(contact.direction)
        _add_contact(mbs, contact, row, float(row @ displacement) + contact.gap, (node, ground))
    wanted = (exu.OutputVariableType.Coordinates, exu.OutputVariableType.Coordinates_t)
    sensors = [
        mbs.AddSensor(eii.SensorNode(nodeNumber=node, outputVariableType=kind, storeInternal=True, writeToFile=False))
        for kind in wanted
    ]
    mbs.Assemble()
    return sensors


def _add_contact(mbs: Any, contact: UnilateralContact, row: np.ndarray, gap: float, nodes: tuple[Any, Any]) -> None:
    """Exudyn's gap is q(marker 1) - q(marker 0) - offset: markers by the sign of their coefficient.

    gap: at the start [m], from which Exudyn takes whether the contact is closed. nodes: the structure's, the ground's
    marker.
    """
    node, ground = nodes
    places = np.flatnonzero(row)
    size = abs(float(row[places[0]]))
    alone = len(places) == 1 or (len(places) == 2 and row[places[0]] == -row[places[1]])
    if contact.rigid or not alone:
        raise MultiPhiValueError(
            f"contact {contact.name!r}: got stiffness {contact.stiffness:g} on {len(places)} coordinates, need a "
            "finite one on one coordinate, or between two with opposite coefficients"
        )
    markers = {-1.0: ground, 1.0: ground}
    for place in places:
        coordinate = eii.MarkerNodeCoordinate(nodeNumber=node, coordinate=int(place))
        markers[float(np.sign(row[place]))] = mbs.AddMarker(coordinate)
    away = contact.gap / size
    data = mbs.AddNode(eii.NodeGenericData(initialCoordinates=[gap / size], numberOfDataCoordinates=1))
    mbs.AddObject(
        eii.ObjectContactCoordinate(
            markerNumbers=[markers[-1.0], markers[1.0]],
            nodeNumber=data,
            contactStiffness=contact.stiffness * size**2,
            offset=-away,
        )
    )


def _solve(mbs: Any, t_end: float, steps: int, cpu_limit_s: float | None) -> None:
    settings = simulation_settings(FullBeamSettings(step=t_end / steps, newton_tolerance=NEWTON), t_end)
    settings.timeIntegration.numberOfSteps = steps
    settings.solution.sensors.writePeriod = t_end / steps
    try:
        mbs.SolveDynamic(settings)
    except exu.SolverError as error:
        said = mbs.sys["dynamicSolver"].GetErrorString() or str(error)
        raise NumericalFailure(" ".join(said.split())) from error
    if mbs.sys["dynamicSolver"].output.simulationTimeout:
        raise NumericalFailure(f"CPU limit of {cpu_limit_s:g} s reached")


def _strain(
    structure: LinearStructure,
    contacts: Sequence[UnilateralContact],
    gaps: dict[str, np.ndarray],
    q: np.ndarray,
) -> np.ndarray:
    strain = np.sum(q * (structure.stiffness @ q.T).T, axis=1) / 2
    springs = [c.stiffness * np.minimum(0.0, gaps[c.name]) ** 2 / 2 for c in contacts]
    return np.asarray(strain + sum(springs))


def _dense(matrix: Any) -> np.ndarray:
    return matrix.toarray() if scipy.sparse.issparse(matrix) else np.asarray(matrix)
