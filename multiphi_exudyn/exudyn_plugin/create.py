"""CreateMultiPhiBody: adds the reduced model to an Exudyn system, as Exudyn's own Create functions add theirs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from exudyn.itemInterface import NodeGenericData, NodeGenericODE2, ObjectGenericODE2, VObjectGenericODE2

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError, NumericalFailure
from multiphi_exudyn.exudyn_plugin.body import MultiPhiBody, flags, matrices
from multiphi_exudyn.exudyn_plugin.sensors import add_sensors
from multiphi_exudyn.exudyn_plugin.switching import bodies_of
from multiphi_exudyn.loads import ConstantLoad
from multiphi_exudyn.model import MultiPhiModel, Tolerance
from multiphi_exudyn.motion import Motion
from multiphi_exudyn.simulate import simulate
from multiphi_exudyn.structure import is_real

__all__ = ["CreateMultiPhiBody"]

SHORTEST = 1e-12  # s: end of the run by which a start is checked and put into its level


def CreateMultiPhiBody(
    mbs: Any,
    model: MultiPhiModel,
    name: str = "",
    displacement: np.ndarray | None = None,
    velocity: np.ndarray | None = None,
    loads: Sequence[ConstantLoad] = (),
    matchedStepSize: float | None = None,
    show: bool = True,
) -> dict[str, Any]:
    """Add the reduced model to an Exudyn system, before ``mbs.Assemble()``.

    mbs: the system. model: structure, contacts and modes. name: of the body, and of its items with a prefix.
    displacement, velocity: x, x' (n,) at the start, None for zero. loads: constant loads on the structure.
    matchedStepSize: None, or the fixed step size h [s] of the solver; the body alone is then exact at that step
    with TrapezoidalIndex2 or GeneralizedAlpha of spectralRadius 1. Velocities of the node are then those of
    stepped_level.py. show: as in other Create functions.

    Returns typed indices: nGenericODE2, oGenericODE2, nGenericData (not without contacts), sCoordinates,
    sCoordinates_t, sCoordinates_tt and sLevel. ``body_histories(mbs, items)`` turns the sensors into displacements
    and forces; ``mbs.variables['multiPhi'][name].events`` holds the events with times inside steps.
    """
    bodies = bodies_of(mbs)
    name = name or next(f"multiPhi{i}" for i in itertools.count() if f"multiPhi{i}" not in bodies)
    if name in bodies:
        raise MultiPhiValueError(f"name: got {name!r}, which this system has already, need another one")
    if not isinstance(model, MultiPhiModel):
        raise MultiPhiTypeError(f"model: got {type(model).__name__}, need a MultiPhiModel")
    if isinstance(model.modes, Tolerance):
        raise MultiPhiValueError(f"model: got modes = {model.modes}, need numbers of modes, as in simulate(...).model")
    _check_step(matchedStepSize)
    body = MultiPhiBody(name, _motion(model, displacement, velocity, loads), matchedStepSize)
    body.items.update(_add_items(mbs, body, show))
    body.items.update(add_sensors(mbs, body))
    bodies[name] = body
    if model.contacts or matchedStepSize is not None:
        bodies.install(mbs)
    return dict(body.items)


def _check_step(step: float | None) -> None:
    if step is None:
        return
    if not is_real(step):
        raise MultiPhiTypeError(f"matchedStepSize: got {step!r}, need a step size in s or None")
    if not (math.isfinite(step) and step > 0):
        raise MultiPhiValueError(f"matchedStepSize: got {step!r}, need a step size > 0 s or None")


def _motion(
    model: MultiPhiModel,
    displacement: np.ndarray | None,
    velocity: np.ndarray | None,
    loads: Sequence[ConstantLoad],
) -> Motion:
    """A motion at its start, checked as ``simulate`` checks it."""
    start = simulate(model, SHORTEST, displacement, velocity, loads, compiled=False)
    motion = Motion(model, model.rules[start.load.tobytes()], start.start)
    if motion.message:
        raise NumericalFailure(motion.message)
    return motion


def _add_items(mbs: Any, body: MultiPhiBody, show: bool) -> dict[str, Any]:
    stepped, (q, q_t) = body.stepped_level(body.state.closed), body.start
    node = mbs.AddNode(
        NodeGenericODE2(
            name=f"Node:{body.name}",
            referenceCoordinates=np.zeros(stepped.size),
            initialCoordinates=q,
            initialCoordinates_t=q_t,
            numberOfODE2Coordinates=stepped.size,
        )
    )
    items = {"nGenericODE2": node}
    items["oGenericODE2"] = mbs.AddObject(
        ObjectGenericODE2(
            name=body.name, nodeNumbers=[node], **matrices(stepped), visualization=VObjectGenericODE2(show=show)
        )
    )
    if body.model.contacts:
        values = flags(body.state)
        items["nGenericData"] = mbs.AddNode(
            NodeGenericData(
                name=f"Node:{body.name}.level", initialCoordinates=values, numberOfDataCoordinates=len(values)
            )
        )
    return items
