"""A Craig-Bampton component in Exudyn, with contact elements on its interface coordinates.

    M_q q'' + C_q q' + K_q q = sum lambda_i d(g_i)/dq,   lambda_i = k_i max(0, -g_i)

One NodeGenericODE2 and ObjectGenericODE2 with constant matrices, ObjectContactCoordinate as in the full beam, and
sensors inside Exudyn: no Python code runs between two steps. Chosen by measurement: modified Newton, the mass matrix
kept, dense matrices. The cost hardly depends on the Newton tolerance down to 1e-8.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.contact import UnilateralContact
from reference_models.craig_bampton import CraigBampton
from reference_models.exudyn_quiet import quiet
from reference_models.point_contact import PointContact

__all__ = ["CraigBamptonRun", "CraigBamptonSettings", "interface_contacts", "solve_craig_bampton"]

SMALLEST_STEP = 1 / 256  # of the step: an iteration that still fails there will not converge at all
SWITCHES = 5  # contact iterations in a time step


@dataclass(frozen=True)
class CraigBamptonSettings:
    """How a component is integrated.

    step: [s]. newton_tolerance: relative and absolute, and that of a contact force [N] whose contact switches in a
    step; a lax one leaves the run with less than order 2. spectral_radius: of generalised alpha, 1 is the trapezoidal
    rule. output_step: shortest time [s] between two recorded steps.
    """

    step: float
    newton_tolerance: float
    spectral_radius: float = 1.0
    output_step: float = 0.0


@dataclass(frozen=True)
class CraigBamptonRun:
    """What was recorded: time (s,) [s], coordinates and velocities (s, b + m).

    cause: why the solver stopped early, or "". steps: of the solver. cpu_s: its CPU time [s].
    """

    cause: str
    time: np.ndarray
    coordinates: np.ndarray
    velocities: np.ndarray
    steps: int
    cpu_s: float


def interface_contacts(contacts: Sequence[UnilateralContact]) -> tuple[PointContact, ...]:
    """The contacts as penalty contacts of single points; raises MultiPhiValueError where they are none."""
    return tuple(_point_contact(contact) for contact in contacts)


def _point_contact(contact: UnilateralContact) -> PointContact:
    if contact.rigid:
        raise MultiPhiValueError(f"contact {contact.name!r} stiffness: got inf, need a finite one (a penalty spring)")
    direction = contact.direction
    given = {direction: 1.0} if isinstance(direction, str) else direction
    if not (isinstance(given, Mapping) and len(given) == 1 and all(given.values())):
        raise MultiPhiValueError(
            f"contact {contact.name!r} direction: got {direction!r}, need one point, or one point with a coefficient"
        )
    ((point, coefficient),) = given.items()
    return PointContact(contact.name, point, float(coefficient), contact.gap, contact.stiffness)


def solve_craig_bampton(
    component: CraigBampton,
    contacts: Sequence[PointContact],
    start: np.ndarray,
    t_end: float,
    settings: CraigBamptonSettings,
) -> CraigBamptonRun:
    """Motion from rest at q = ``start`` (b + m,) to t_end [s]; every contact is on an interface point."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    with quiet():
        sensors = _build(mbs, component, contacts, start)
        mbs.Assemble()
        solver = _simulation_settings(t_end, settings)
        started = time.process_time()
        cause = _solve(mbs, solver)
        taken = time.process_time() - started
    coordinates, velocities = (mbs.GetSensorStoredData(sensor) for sensor in sensors)
    steps = mbs.sys["dynamicSolver"].it.currentStepIndex - 1
    return CraigBamptonRun(cause, coordinates[:, 0], coordinates[:, 1:], velocities[:, 1:], steps, taken)


def _build(mbs: Any, component: CraigBampton, contacts: Sequence[PointContact], start: np.ndarray) -> list[Any]:
    count = component.dofs
    node = mbs.AddNode(
        eii.NodeGenericODE2(
            numberOfODE2Coordinates=count,
            referenceCoordinates=np.zeros(count),
            initialCoordinates=start,
            initialCoordinates_t=np.zeros(count),
        )
    )
    mbs.AddObject(
        eii.ObjectGenericODE2(
            nodeNumbers=[node],
            massMatrix=component.mass,
            dampingMatrix=component.damping,
            stiffnessMatrix=component.stiffness,
        )
    )
    ground = _marker(mbs, mbs.AddNode(eii.NodePointGround()), 0)
    for contact in contacts:
        coordinate = component.interface.index(contact.point)
        _add_contact(mbs, contact, ground, _marker(mbs, node, coordinate), float(start[coordinate]))
    kinds = exu.OutputVariableType.Coordinates, exu.OutputVariableType.Coordinates_t
    return [
        mbs.AddSensor(eii.SensorNode(nodeNumber=node, outputVariableType=kind, storeInternal=True)) for kind in kinds
    ]


def _marker(mbs: Any, node: Any, coordinate: int) -> Any:
    return mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate))


def _add_contact(mbs: Any, contact: PointContact, ground: Any, point: Any, deflection: float) -> None:
    """Exudyn's gap is q(marker 1) - q(marker 0) - offset, its force acts along +q of marker 1."""
    travel = deflection if contact.above else -deflection
    state = eii.NodeGenericData(initialCoordinates=[contact.distance - travel], numberOfDataCoordinates=1)
    mbs.AddObject(
        eii.ObjectContactCoordinate(
            markerNumbers=[point, ground] if contact.above else [ground, point],
            nodeNumber=mbs.AddNode(state),
            contactStiffness=contact.spring,
            offset=-contact.distance,
        )
    )


def _simulation_settings(t_end: float, settings: CraigBamptonSettings) -> Any:
    found = exu.SimulationSettings()
    found.solution.file.write = False
    found.solution.sensors.writePeriod = settings.output_step
    found.linearSolver.solverType = exu.LinearSolverType.EXUdense
    integration = found.timeIntegration
    integration.endTime = t_end
    integration.numberOfSteps = max(1, math.ceil(t_end / settings.step - 1e-6))
    integration.minimumStepSize = settings.step * SMALLEST_STEP
    integration.verboseMode = 0
    integration.reuseConstantMassMatrix = True
    integration.generalizedAlpha.spectralRadius = settings.spectral_radius
    integration.newton.useModifiedNewton = True
    integration.newton.relativeTolerance = settings.newton_tolerance
    integration.newton.absoluteTolerance = settings.newton_tolerance
    integration.discontinuous.useRecommendedStepSize = False
    integration.discontinuous.ignoreMaxIterations = True
    integration.discontinuous.maxIterations = SWITCHES
    integration.discontinuous.iterationTolerance = settings.newton_tolerance
    return found


def _solve(mbs: Any, solver: Any) -> str:
    try:
        mbs.SolveDynamic(solver)
    except exu.SolverError as error:
        said = mbs.sys["dynamicSolver"].GetErrorString() or str(error)
        return " ".join(said.split())
    return ""
