"""CreateMultiPhiBody: adds the reduced model to an Exudyn system, as Exudyn's own Create functions add theirs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import NodeGenericData, NodeGenericODE2, ObjectGenericODE2, VObjectGenericODE2

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError, NumericalFailure
from multiphi_exudyn.exudyn_plugin.body import MultiPhiBody
from multiphi_exudyn.exudyn_plugin.drawing import Drawing, check_drawing, graphics_of
from multiphi_exudyn.exudyn_plugin.interface import Interface, InterfaceNode, InterfacePoint, interface_nodes
from multiphi_exudyn.exudyn_plugin.sensors import add_sensors
from multiphi_exudyn.exudyn_plugin.solver import bodies_of
from multiphi_exudyn.exudyn_plugin.state import matrices
from multiphi_exudyn.levels.equilibrium.static_equilibrium import Equilibrium
from multiphi_exudyn.levels.model.mode_choice import Tolerance
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.arguments import is_real
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.loads import ConstantLoad, Gravity, Load
from multiphi_exudyn.time.motion import Motion
from multiphi_exudyn.time.simulate import Run, base_warnings_of, check_start, holding
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["CreateMultiPhiBody", "bind"]

PROVISIONAL = 1.0  # s: end of the run for which the loads are prepared, until the solver gives the real one


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
    """Add the reduced model to an Exudyn system, before ``mbs.Assemble()``; also ``mbs.CreateMultiPhiBody(...)``.

        M q'' + D q' + K q = drive + (loads and connectors of the system)

    q are the modal coordinates eta of the present level.

    A body on which nothing acts but its own loads follows the motion of ``simulate``. A body beside others has steps of
    second order, with events at their exact times inside the steps.

    Parameters
    ----------
    mbs : exudyn.MainSystem
        The system.
    model : MultiPhiModel
        Structure, contacts and numbers of modes.
    name : str, default ""
        Name of the body, and with a prefix of its items; empty for "multiPhi0", "multiPhi1", ...
    displacement, velocity : array (n,), default None
        x [m, rad] and x' [m/s, rad/s] at the start, None for zero.
    loads : sequence of loads, default ()
        As of ``simulate``. The modal base of a large structure includes the static responses to them and to forces on
        the ``interface``.
    matchedStepSize : float, default None
        The fixed step size [s] of the solver, to which the modes are matched: without other forces the body is then
        exact at that step with TrapezoidalIndex2, or GeneralizedAlpha of spectralRadius 1. Velocities of the node are
        those of the matched modes. Without it a run warns where its steps delay the motion by more than 0.5 %.
    interface : iterable of str, or mapping of str to point, default ()
        Points on which connectors, loads and sensors of the system act: names of points or {name: point or row}, one
        coordinate each; or {name: PositionInterface or RigidInterface}, positions and frames to which markers of
        positions and of rigid bodies attach. Needs TrapezoidalIndex2 and constant ``loads``. Where an
        ObjectContactCoordinate acts on them, set ``timeIntegration.discontinuous.useRecommendedStepSize=False``: its
        shorter steps gain nothing, and with matchedStepSize they are an error.
    show : bool, default True
        As in other Create functions.
    drawing : Drawing, default None
        Drawing of the body in the renderer, None for none.
    start : Trajectory or Equilibrium, default None
        As of ``simulate``, instead of a displacement. The body takes the whole final state of a trajectory, and time
        begins anew.
    color : sequence of float, default (-1, -1, -1, -1)
        Red, green, blue and opacity, as in other Create functions; negative for the default.

    Returns
    -------
    dict
        Typed indices: nGenericODE2, oGenericODE2, nGenericData and sLevel (both only with contacts), sCoordinates,
        sCoordinates_t, sCoordinates_tt; with an interface nInterface {name: NodeIndex} and sInterface
        {name: SensorIndex}, the forces on its coordinates. ``body_histories(mbs, items)`` computes displacements and
        forces from the sensors. ``mbs.variables["multiPhi"][name]`` has the ``events``, with times inside steps, and
        the ``warnings``; each warning is issued as a MultiPhiWarning at the end of a run.

    Raises
    ------
    MultiPhiTypeError
        For arguments of another kind.
    MultiPhiValueError
        For a name that is in use, a model with a Tolerance, a step that is not > 0; with an interface for loads that
        vary, moving counter-surfaces, and rigid contacts with friction; and for arguments that ``simulate`` refuses.
    NumericalFailure
        If the computation of the start fails.

    Examples
    --------
    >>> import numpy as np
    >>> import exudyn as exu
    >>> import multiphi_exudyn as mp
    >>> from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, body_histories
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> container = exu.SystemContainer()
    >>> mbs = container.AddSystem()
    >>> pulled = model.static_equilibrium({"tip": 100.0})
    >>> given = {"displacement": pulled, "matchedStepSize": 1e-3}
    >>> items = CreateMultiPhiBody(mbs, model, name="chain", **given)
    >>> mbs.Assemble()
    >>> settings = exu.SimulationSettings()
    >>> settings.solution.file.write = False
    >>> settings.timeIntegration.endTime = 0.1
    >>> settings.timeIntegration.numberOfSteps = 100
    >>> solver = exu.DynamicSolverType.TrapezoidalIndex2
    >>> done = mbs.SolveDynamic(settings, solverType=solver)
    >>> mbs.variables["multiPhi"]["chain"].events[0].kind
    'close'
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
        raise MultiPhiValueError(
            f"model: got modes={model.modes}, which only a run decides; need the model of one, simulate(...).model"
        )
    _check_step(matchedStepSize)
    check_drawing(drawing, color, model)
    nodes = interface_nodes(model.structure, interface)
    rows = [node.rows for node in nodes]
    model = holding(model, loads, start, rows)
    run = Run(model, PROVISIONAL, displacement, velocity, loads, start=start, rewound=True)
    check_start(run)
    body = MultiPhiBody(name, _motion(run), loads, PROVISIONAL, matchedStepSize, base_warnings_of(run, model, rows))
    moving_surfaces = [link for link in model.links if link.velocity]
    if nodes and moving_surfaces:
        name, speed = moving_surfaces[0].name, moving_surfaces[0].velocity
        raise MultiPhiValueError(
            f"velocity of {name!r}: got {speed:g} m/s of the counter-surface in a body with an interface, need 0 m/s"
        )
    rigid_with_friction = [
        c.name for c in model.contacts if isinstance(c, UnilateralContact) and c.rigid and c.friction
    ]
    if nodes and rigid_with_friction:
        received = f"rigid contacts with friction ({', '.join(rigid_with_friction)}) in a body with an interface"
        raise MultiPhiValueError(f"friction: got {received}, need a finite stiffness of these contacts")
    if nodes and body.varies:
        varying = {type(load).__name__ for load in loads if not isinstance(load, (ConstantLoad, Gravity))}
        raise MultiPhiValueError(
            f"loads: got {', '.join(sorted(varying))} in a body with an interface, need constant loads (give a varying "
            "force as a load of the Exudyn system on an interface coordinate)"
        )
    visualization = {"show": show, "color": list(color)}
    body.items.update(_add_items(mbs, body, visualization, drawing))
    if nodes:
        _add_interface(mbs, body, nodes, visualization)
    body.items.update(add_sensors(mbs, body))
    bodies.add(body)
    if model.contacts or nodes or matchedStepSize is not None or body.varies:
        bodies.install(mbs)
    if body.varies:
        bodies.install_pre_step(mbs)
    return dict(body.items)


def _check_step(step: float | None) -> None:
    if step is None:
        return
    if not is_real(step):
        raise MultiPhiTypeError(f"matchedStepSize: got {step!r}, need a step size in s or None")
    if not (math.isfinite(step) and step > 0):
        raise MultiPhiValueError(f"matchedStepSize: got {step!r}, need a step size > 0 s or None")


def _motion(run: Run) -> Motion:
    """The motion of a run, at its start."""
    motion = run.begun()
    if motion.message:
        raise NumericalFailure(motion.message)
    return motion


def _add_items(mbs: Any, body: MultiPhiBody, visualization: dict[str, Any], drawing: Drawing | None) -> dict[str, Any]:
    discretised, (q, q_t) = body.discretised_level(body.state.states), body.start
    node = mbs.AddNode(
        NodeGenericODE2(
            name=f"Node:{body.name}",
            referenceCoordinates=np.zeros(discretised.size),
            initialCoordinates=q,
            initialCoordinates_t=q_t,
            numberOfODE2Coordinates=discretised.size,
        )
    )
    items = {"nGenericODE2": node}
    items["oGenericODE2"] = mbs.AddObject(
        ObjectGenericODE2(
            name=body.name,
            nodeNumbers=[node],
            **matrices(discretised, body.force_vector(discretised)),
            visualization=VObjectGenericODE2(
                **visualization,
                graphicsDataUserFunction=0 if drawing is None else graphics_of(body, drawing, visualization["color"]),
            ),
        )
    )
    if body.model.contacts:
        values = body.coordinates.layout.from_state(body.state)
        items["nGenericData"] = mbs.AddNode(
            NodeGenericData(
                name=f"Node:{body.name}.level", initialCoordinates=values, numberOfDataCoordinates=len(values)
            )
        )
    return items


def _add_interface(mbs: Any, body: MultiPhiBody, nodes: Sequence[InterfaceNode], visualization: dict[str, Any]) -> None:
    interface = body.coordinates.interface = Interface(mbs, body.name, nodes, body.model.most_levels)
    discretised = body.discretised_level(body.state.states)
    interface.add(body.items["nGenericODE2"], discretised, body.state.held, *body.start, visualization)
    body.items["nInterface"], body.items["sInterface"] = interface.nodes, interface.sensors


def bind(function: Callable[..., Any]) -> None:
    """Make ``function(mbs, ...)`` a method of ``mbs``, unless Exudyn has a method of this name itself.

    Exudyn's registry is used if it exists, else a plain class attribute.
    """
    name = function.__name__
    if hasattr(exu.MainSystem, name):
        return
    try:
        from exudyn.misc.extensionRegistry import extends, install
    except ImportError:
        setattr(exu.MainSystem, name, function)
        return
    extends(exu.MainSystem, name)(function)
    install()
