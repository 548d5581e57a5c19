"""Run checks: what a body needs of the solver, of its steps, and of the system at the start of a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.body.coordinates import SAME_STEP, Coordinates
from multiphi_exudyn.exudyn_plugin.body.switching import bodies_of

__all__ = ["check_integration", "check_matched", "check_start"]

ROUND_OFF = 1e-12  # of the energy at the start: an impact that takes less is none


class CheckedBody(Protocol):
    """What is needed of a body. matched_step: that its modes are matched to [s], or None."""

    name: str
    items: dict[str, Any]
    coordinates: Coordinates
    matched_step: float | None


def check_matched(body: CheckedBody, step: float) -> None:
    """Raises where steps of this length [s] are not those to which modes are matched."""
    if body.matched_step is not None and abs(step - body.matched_step) > SAME_STEP * step:
        raise MultiPhiValueError(
            f"matchedStepSize of {body.name!r}: got {body.matched_step:g} s and a solver's step of "
            f"{step:g} s, need the same (beside Exudyn's own contacts set discontinuous.useRecommendedStepSize=False)"
        )


def check_integration(body: CheckedBody, settings: Any, trapezoidal: bool) -> None:
    """Raises for settings of an implicit solver that make a body wrong; TrapezoidalIndex2 has its own."""
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


def check_start(mbs: Any, body: CheckedBody, given: Sequence[np.ndarray], lost: float) -> None:
    """Raises for what cannot be struck together with a body that has rigid contacts.

    given: q, q' (s,) as it was made; lost: what impacts took there [J].
    """
    here = body.coordinates
    around = here.surroundings or here.beside(mbs)
    if around.on_body(here.stepped.mass):
        raise MultiPhiValueError(
            f"node of {body.name!r}: got a mass or a constraint on the node of a body with rigid contacts, need it "
            "on an interface coordinate or as part of the structure, or contacts of finite stiffness"
        )
    around.apart = {
        mbs.GetNodeODE2Index(other.items["nGenericODE2"]): other.name
        for other in bodies_of(mbs).values()
        if other is not body and other.rigid
    }
    attached = around.hanging(around.present(), here.stepped.mass).attached
    q_t = here.views[1]
    fresh = np.array_equal(here.views[:2], given)
    struck = fresh and lost > ROUND_OFF * (lost + 0.5 * float(q_t @ q_t))
    if struck and np.any(attached.impedance(np.eye(len(attached.mass)))):
        raise MultiPhiValueError(
            f"start of {body.name!r}: got a velocity into a rigid contact, with masses or constraints on the "
            "interface, need a start without an impact"
        )
