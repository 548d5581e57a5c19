"""CreateMultiPhiBody: adds the reduced model to an Exudyn system, as Exudyn's own Create functions add theirs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import NodeGenericData, NodeGenericODE2, ObjectGenericODE2, VObjectGenericODE2

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError, NumericalFailure
from multiphi_exudyn.exudyn_plugin.body.body import MultiPhiBody
from multiphi_exudyn.exudyn_plugin.body.coordinates import matrices
from multiphi_exudyn.exudyn_plugin.body.drawing import Drawing, check_drawing, graphics_of
from multiphi_exudyn.exudyn_plugin.body.sensors import add_sensors
from multiphi_exudyn.exudyn_plugin.body.switching import bodies_of
from multiphi_exudyn.exudyn_plugin.coupling.interface import Interface
from multiphi_exudyn.exudyn_plugin.coupling.interface_nodes import InterfaceNode, InterfacePoint, interface_nodes
from multiphi_exudyn.levels.mode_choice import Tolerance
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.levels.static_equilibrium import Equilibrium
from multiphi_exudyn.mechanics.arguments import is_real
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.loads import ConstantLoad, Gravity, Load
from multiphi_exudyn.time.motion import Motion
from multiphi_exudyn.time.simulate import Run, started
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["CreateMultiPhiBody"]

PROVISIONAL = 1.0  # s: end of the run that a start belongs to, until the solver tells its own


def CreateMultiPhiBody(
    mbs: Any,
    model: MultiPhiModel,
    name: str = "",
    displacement: np.ndarray | None = None,
    velocity: np.ndarray | None = None,
    loads: Sequence[Load] = (),
    matchedStepSize: float | None = None,
    interface: Iterable[str] | Mapping[str, InterfacePoint] = (),
    show: bool = True,
    drawing: Drawing | None = None,
    start: Trajectory | Equilibrium | None = None,
    color: Sequence[float] = (-1.0, -1.0, -1.0, -1.0),
) -> dict[str, Any]:
    """Add the reduced model to an Exudyn system, before ``mbs.Assemble()``.

    mbs: the system. model: structure, contacts and modes. name: of the body, and of its items with a prefix.
    displacement, velocity: x, x' (n,) at the start, None for zero. loads: as in ``simulate``. start: as there; where it
    is a trajectory its final state is handed on whole, and time begins anew.
    matchedStepSize: None, or the fixed step size h [s] of the solver; the body alone is then exact at that step
    with TrapezoidalIndex2 or GeneralizedAlpha of spectralRadius 1. Velocities of the node are then those of
    stepped_level.py. interface: what connectors, loads and sensors act on: names of points or {name: point or row},
    one coordinate each, or {name: PositionInterface or RigidInterface}, positions and frames to which markers of
    positions and of rigid bodies attach (interface_nodes.py); needs TrapezoidalIndex2 and constant loads. Where an
    ObjectContactCoordinate acts on them, set ``timeIntegration.discontinuous.useRecommendedStepSize=False``:
    shorter steps than the others are no gain, and with matchedStepSize an error. show, color: as in other
    Create functions (RGBA, negative for the usual). drawing: None, or how the renderer shows the body.

    Returns typed indices: nInterface and sInterface (only if asked for: {name: NodeIndex}, and {name: SensorIndex},
    the forces on its coordinates), nGenericODE2, oGenericODE2, nGenericData (not without contacts), sCoordinates,
    sCoordinates_t, sCoordinates_tt and sLevel. ``body_histories(mbs, items)`` turns the sensors into displacements
    and forces; ``mbs.variables['multiPhi'][name]`` has the ``events`` with times inside steps, and the
    ``warnings``: what to distrust in the run so far; at its end a MultiPhiWarning is issued for each of them.
    """
    if not isinstance(mbs, exu.MainSystem):
        raise MultiPhiTypeError(f"mbs: got {type(mbs).__name__}, need an Exudyn MainSystem")
    if not isinstance(name, str):
        raise MultiPhiTypeError(f"name: got {name!r}, need a string")
    bodies = bodies_of(mbs)
    name = name or next(f"multiPhi{i}" for i in itertools.count() if f"multiPhi{i}" not in bodies)
    if name in bodies:
        raise MultiPhiValueError(f"name: got {name!r}, which this system has already, need another one")
    if not isinstance(model, MultiPhiModel):
        raise MultiPhiTypeError(f"model: got {type(model).__name__}, need a MultiPhiModel")
    if isinstance(model.modes, Tolerance):
        raise MultiPhiValueError(f"model: got modes = {model.modes}, need numbers of modes, as in simulate(...).model")
    _check_step(matchedStepSize)
    check_drawing(drawing, color, model)
    nodes = interface_nodes(model.structure, interface)
    body = MultiPhiBody(
        name,
        _motion(Run(model, PROVISIONAL, displacement, velocity, loads, start=start, rewound=True)),
        loads,
        PROVISIONAL,
        matchedStepSize,
    )
    moving = [link for link in model.links if link.velocity]
    if nodes and moving:
        name, speed = moving[0].name, moving[0].velocity
        raise MultiPhiValueError(f"velocity of {name!r}: got {speed:g} with an interface, need 0 m/s")
    rough = [c.name for c in model.contacts if isinstance(c, UnilateralContact) and c.rigid and c.friction]
    if nodes and rough:
        given = f"rigid contacts with it ({', '.join(rough)}) and an interface"
        raise MultiPhiValueError(f"friction: got {given}, need compliant ones")
    if nodes and body.varies:
        varying = {type(load).__name__ for load in loads if not isinstance(load, (ConstantLoad, Gravity))}
        raise MultiPhiValueError(
            f"loads: got {', '.join(sorted(varying))} with an interface, need constant loads (a varying force can be a "
            "load of the system on an interface coordinate)"
        )
    look = {"show": show, "color": list(color)}
    body.items.update(_add_items(mbs, body, look, drawing))
    if nodes:
        _add_interface(mbs, body, nodes, look)
    body.items.update(add_sensors(mbs, body))
    bodies.add(body)
    if model.contacts or nodes or matchedStepSize is not None or body.varies:
        bodies.install(mbs)
    if body.varies:
        bodies.install_before(mbs)
    return dict(body.items)


def _check_step(step: float | None) -> None:
    if step is None:
        return
    if not is_real(step):
        raise MultiPhiTypeError(f"matchedStepSize: got {step!r}, need a step size in s or None")
    if not (math.isfinite(step) and step > 0):
        raise MultiPhiValueError(f"matchedStepSize: got {step!r}, need a step size > 0 s or None")


def _motion(run: Run) -> Motion:
    """A motion at its start, checked as ``simulate`` checks it."""
    motion = started(run).begun()
    if motion.message:
        raise NumericalFailure(motion.message)
    return motion


def _add_items(mbs: Any, body: MultiPhiBody, look: dict[str, Any], drawing: Drawing | None) -> dict[str, Any]:
    stepped, (q, q_t) = body.stepped_level(body.state.states), body.start
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
            name=body.name,
            nodeNumbers=[node],
            **matrices(stepped, body.force_vector(stepped)),
            visualization=VObjectGenericODE2(
                **look, graphicsDataUserFunction=0 if drawing is None else graphics_of(body, drawing, look["color"])
            ),
        )
    )
    if body.model.contacts:
        values = body.coordinates.layout.of(body.state)
        items["nGenericData"] = mbs.AddNode(
            NodeGenericData(
                name=f"Node:{body.name}.level", initialCoordinates=values, numberOfDataCoordinates=len(values)
            )
        )
    return items


def _add_interface(mbs: Any, body: MultiPhiBody, nodes: Sequence[InterfaceNode], look: dict[str, Any]) -> None:
    interface = body.coordinates.interface = Interface(mbs, body.name, nodes, body.model.most_levels)
    stepped = body.stepped_level(body.state.states)
    interface.add(body.items["nGenericODE2"], stepped, body.state.held, *body.start, look)
    body.items["nInterface"], body.items["sInterface"] = interface.nodes, interface.sensors
