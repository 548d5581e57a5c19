"""Run checks: requirements of a body on the solver, on its step size, and on the system at the start of a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.body.solver.switching import bodies_of
from multiphi_exudyn.exudyn_plugin.body.state.coordinates import SAME_STEP, Coordinates

__all__ = ["check_integration", "check_level", "check_matched", "check_start"]

ROUND_OFF = 1e-12  # of the energy at the start: an impact with a smaller loss is none


class CheckedBody(Protocol):
    """Attributes of a body that the checks need; matched_step: step size [s] its modes are matched to, or None."""

    name: str
    items: dict[str, Any]
    coordinates: Coordinates
    matched_step: float | None


def check_matched(body: CheckedBody, step: float) -> None:
    """Raise where modes are matched to another step size than this one [s]."""
    if body.matched_step is not None and abs(step - body.matched_step) > SAME_STEP * step:
        raise MultiPhiValueError(
            f"matchedStepSize of {body.name!r}: got {body.matched_step:g} s and a solver's step of "
            f"{step:g} s, need the same (beside Exudyn's own contacts set discontinuous.useRecommendedStepSize=False)"
        )


def check_level(body: CheckedBody, states: tuple[int, ...], last_states: tuple[int, ...], last: np.ndarray) -> None:
    """Raise for a start at the coordinates (s,) of the last solution in another level than its own.

    states, last_states: of the elements at the start, and in the last solution.
    """
    if states != last_states and np.array_equal(body.coordinates.views[0], last):
        raise MultiPhiValueError(
            f"start of {body.name!r}: got the coordinates of the last solution without its level, need its whole "
            "state: updateInitialValues=True, or "
            "mbs.systemData.SetSystemState(mbs.systemData.GetSystemState(), exu.ConfigurationType.Initial)"
        )


def check_integration(body: CheckedBody, settings: Any, trapezoidal: bool) -> None:
    """Raise for settings of an implicit solver with which a body is not exact or unstable.

    trapezoidal: whether the solver is TrapezoidalIndex2, which does not use the settings of GeneralizedAlpha.
    """
    integration, interface = settings.timeIntegration.generalizedAlpha, body.coordinates.interface
    if not (trapezoidal or integration.useNewmark) and integration.spectralRadius != 1:
        other = "" if interface is not None else " (or spectralRadius = 1)"
        raise MultiPhiValueError(
            f"solver: got GeneralizedAlpha with spectralRadius {integration.spectralRadius:g} (Exudyn's default is "
            f"0.9), with which events of the Multi-Phi body {body.name!r} are not exact; need TrapezoidalIndex2"
            f"{other}: mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)"
        )
    if interface is not None and not (trapezoidal or integration.useIndex2Constraints):
        raise MultiPhiValueError(
            f"solver: got GeneralizedAlpha of index 3, with which the interface of {body.name!r} is unstable; need "
            "TrapezoidalIndex2: mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)"
        )


def check_start(mbs: Any, body: CheckedBody, start: Sequence[np.ndarray], loss: float) -> None:
    """Raise for masses and constraints that cannot take part in impacts of a body with rigid contacts.

    start: q, q' (s,) at creation; loss: energy loss of the impacts there [J].
    """
    coordinates = body.coordinates
    system = coordinates.system or coordinates.system_around(mbs)
    if system.acts_on_body(coordinates.stepped.mass):
        raise MultiPhiValueError(
            f"node of {body.name!r}: got a mass or a constraint on the node of a body with rigid contacts, need it "
            "on an interface coordinate or as part of the structure, or contacts of finite stiffness"
        )
    system.exclusive_bodies = {
        mbs.GetNodeODE2Index(other.items["nGenericODE2"]): other.name
        for other in bodies_of(mbs).values()
        if other is not body and other.rigid
    }
    inertia = system.attached_parts(system.copy_state(), coordinates.stepped.mass).inertia
    q_t = coordinates.views[1]
    as_created = np.array_equal(coordinates.views[:2], start)
    has_impact = as_created and loss > ROUND_OFF * (loss + 0.5 * float(q_t @ q_t))
    if has_impact and np.any(inertia.impedance(np.eye(len(inertia.mass)))):
        raise MultiPhiValueError(
            f"start of {body.name!r}: got a velocity into a rigid contact, with masses or constraints on the "
            "interface, need a start without an impact"
        )
