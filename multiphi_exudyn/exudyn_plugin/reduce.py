"""Reduction of an Exudyn system: its linearisation at the current state, its contacts, stops and friction, as a model.

    q = q_0 + S z + s(t),   M z'' + C z' + K z = p - S^T (K s + C s') + (contacts, friction)
    p = S^T f(q_0, v_0) + C S^T v_0,   z'(0) = S^T v_0

q_0, v_0 are the current coordinates and velocities, moved onto the constraints by the shortest way in the mass metric
(start_state.py), f [N, N m] the forces there without contacts, limit stops, friction and loads by user functions, S the
directions the constraints leave free, s(t) the motion they prescribe by functions of time (timed.py). Points are
displacements from q_0. p is a constant load: a state out of balance starts to move as the system does. A load by a
function of time is a FunctionLoad, with t = 0 at the system's current time, and so is the change with time of the force
of an ObjectGenericODE2. Items that the model does not contain are in ``left_out``, with the reason.

Exudyn's contact dampers pull at separation; those of the model do not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from multiphi_exudyn.display import Shown, names, per_cent
from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.contacts import (
    contact_distance,
    contacts_of,
    default_points,
    frictions_of,
    moved_by,
    requested_points,
    spheres_of,
)
from multiphi_exudyn.exudyn_plugin.items import (
    Item,
    grouped,
    has_contact,
    left_out_directions,
    left_out_functions,
    left_out_objects,
    linearised_functions,
    load_item,
    missing_parts,
    taken_objects,
    user_function,
)
from multiphi_exudyn.exudyn_plugin.linear_range import LinearLimits, LinearRange, MovedBy, RangeCheck, linearised
from multiphi_exudyn.exudyn_plugin.linearize import LinearizedStructure, check_system
from multiphi_exudyn.exudyn_plugin.start_state import moved_onto_constraints
from multiphi_exudyn.exudyn_plugin.system import initial_is_current, items_of, without_contacts
from multiphi_exudyn.exudyn_plugin.timed import (
    Component,
    PrescribedMotion,
    RateLoad,
    TimedLoad,
    function_loads,
    timed_forces,
    timed_loads,
)
from multiphi_exudyn.levels.model.mode_choice import Tolerance, UpTo
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.arguments import Matrix
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.loads import ConstantLoad, FunctionLoad, Load, StopMotion, VaryingLoad
from multiphi_exudyn.mechanics.time_functions import Smooth
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["Reduction", "reduce"]

SMALL = 100  # coordinates up to which all modes are kept by default: a run then has the accuracy of the system's own
HELD = 1e-9  # of a row's largest entry before projection: a smaller row is a contact whose gap constraints fix


@dataclass(frozen=True, repr=False)
class Reduction(Shown):
    """Result of ``reduce`` for an Exudyn system.

    Attributes
    ----------
    model : MultiPhiModel
        Structure, contacts, modes.
    velocity : array (n,)
        z'(0) [m/s, rad/s] of the current state; the displacement z(0) is zero.
    loads : tuple of loads
        The constant load of a state out of balance, none if it is zero, and those by functions of time.
    taken : tuple of Item
        Every item of the system that is part of the model.
    left_out : tuple of (Item, str)
        Items that are not part of it, with the reason.
    symmetrised : tuple of str
        Matrices that were not symmetric, by how much and between which coordinates. The model has their symmetric part;
        ``check`` determines the effect of the skew part.
    shift : array (n_full,)
        Distance of q_0 from the system's current coordinates where these violate constraints, else zero.
    prescribed : callable
        s(t) (n_full,), the motion that constraints prescribe by functions of time; zero without any.
    """

    model: MultiPhiModel
    velocity: np.ndarray
    loads: tuple[Load, ...]
    taken: tuple[Item, ...]
    left_out: tuple[tuple[Item, str], ...]
    symmetrised: tuple[str, ...]
    shift: np.ndarray
    prescribed: Callable[[float], np.ndarray]

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "degrees of freedom", str(self.structure.n)
        yield "contacts", names([contact.name for contact in self.model.contacts])
        yield "modes", str(self.model.modes)
        yield "taken", str(len(self.taken))
        yield "left out", names([str(item) for item, _ in self.left_out])

    @property
    def structure(self) -> LinearizedStructure:
        """M, C, K, the points and S."""
        structure = self.model.structure
        assert isinstance(structure, LinearizedStructure)
        return structure

    def displacement(self, trajectory: Trajectory, times: Any) -> np.ndarray:
        """Displacement of all coordinates of the system from its current ones, q - q_now = shift + S z + s(t).

        Parameters
        ----------
        trajectory : Trajectory
            Of ``simulate`` with this model.
        times : float or array (k,)
            [s], from the start of the trajectory.

        Returns
        -------
        array (n_full,) or (n_full, k)
            [m, rad], in the order of ``mbs.systemData.GetODE2Coordinates()``.

        Raises
        ------
        MultiPhiTypeError
            For something else than a trajectory, and times that are not numbers.
        MultiPhiValueError
            For times outside the trajectory.
        """
        if not isinstance(trajectory, Trajectory):
            raise MultiPhiTypeError(f"trajectory: got {trajectory!r}, need a Trajectory of this model")
        z = trajectory.displacement(times)
        moved = np.transpose([self.prescribed(t) for t in np.atleast_1d(times)]) + self.shift[:, None]
        moved = moved if np.ndim(times) else moved[:, 0]
        return np.asarray(self.structure.coordinates @ z + moved)

    @property
    def report(self) -> str:
        """Text with the items taken and left out, one line for items of one type and one fate."""
        frictions = sum(contact.held for contact in self.model.contacts)
        elements = f"contacts: {len(self.model.contacts) - frictions}, frictions: {frictions}"
        size = f"{self.structure.n} degrees of freedom, {elements}, modes: {self.model.modes}"
        taken = [f"  {line}" for line in grouped((item, item.became) for item in self.taken)]
        left = [f"  {line}" for line in grouped(self.left_out)]
        symmetrised = (
            ["made symmetric", *(f"  {sentence}" for sentence in self.symmetrised)] if self.symmetrised else []
        )
        return "\n".join([size, "taken", *taken, *symmetrised, "left out", *(left or ["  nothing"])])

    def check(self, trajectory: Trajectory) -> RangeCheck:
        """Error of the linearisation in a trajectory of this model; the trajectory's warnings contain it too."""
        validity = self.model.validity
        assert isinstance(validity, (LinearRange, LinearLimits))
        return validity.check(trajectory)

    def report_of(self, trajectory: Trajectory, tolerance: float = 0.01) -> str:
        """Text about the accuracy of a trajectory of this model, a line each for linear range, horizon and warnings.

        Parameters
        ----------
        trajectory : Trajectory
            Of ``simulate`` with this model.
        tolerance : float, default 0.01
            Of the horizon, see ``Trajectory.horizon``.
        """
        check = self.check(trajectory)
        error = f"what the model leaves out moves it by {per_cent(check.error)} of its largest displacement"
        verdict, horizon = "holds" if check.holds else "does not hold", trajectory.horizon(tolerance)
        lines = [
            f"linear range ({verdict}): {f'not checked, {check.reason}' if check.reason else error}",
            f"horizon: determined within {100 * tolerance:g} % until {horizon:.6g} s of {trajectory.t_end:g} s",
        ]
        return "\n".join([*lines, *(f"warning: {sentence}" for sentence in trajectory.warnings)])


def reduce(
    mbs: Any,
    modes: int | str | UpTo | Tolerance | None = None,
    points: Mapping[str, Any] | None = None,
    damping: Matrix | ModalDamping | RayleighDamping | None = None,
    strict: bool = False,
) -> Reduction:
    """Reduce an assembled Exudyn system at its current state; the system is left as it was.

        q = q_0 + S z + s(t),   M z'' + C z' + K z = p - S^T (K s + C s') + (contacts, friction)
        p = S^T f(q_0, v_0) + C S^T v_0,   z'(0) = S^T v_0

    q_0, v_0 are the current coordinates and velocities, f the forces there, S the directions that constraints leave
    free. Where q_0, v_0 violate constraints they are moved onto them, by the shortest way in the mass metric, as by
    Exudyn's generalized-alpha solver; a run says so if q_0 moves. s(t) is the motion that offsets of constraints
    prescribe by functions of time (ObjectConnectorCoordinate and ObjectJointGeneric, also on velocities); what it moves
    is no point of the structure, and in ``Reduction.displacement``. A state out of balance has a constant load p and
    starts to move as the system does. Contacts are ObjectContactCoordinate, contacts of spheres
    (ObjectContactSphereSphere, -SphereTriangle, -SphereTorus, in the direction that they have now) and the limit stops
    of ObjectConnectorCoordinateSpringDamperExt, called ``<object>.upper`` and ``<object>.lower``; friction is that of
    the latter where it is the law of ``mp.Friction``, with the object's name.

    If the system is unstable, or its matrices are not symmetric, because of directions in which nothing moves it
    (neither velocities nor forces, contacts or loads), these directions are left out. Apply loads to the system before
    the reduction: a load in these directions cannot be added to the model later.

    Parameters
    ----------
    mbs : exudyn.MainSystem
        Assembled.
    modes : int, "all", UpTo, Tolerance or None, default None
        Modes of every level, as in MultiPhiModel; a number larger than the system has means all. None: all up to 100,
        else chosen from static responses.
    points : mapping, default None
        As of ``linear_structure_from``: name to marker index, or to (node index, coordinate number); None for all.
    damping : array (n, n), ModalDamping, RayleighDamping or None, default None
        In the coordinates z, or by ratios; None takes what the system's own dampers give.
    strict : bool, default False
        Whether to refuse a system of which parts would be left out, instead of a warning in every run.

    Returns
    -------
    Reduction
        The model, its start and loads, and the items it contains and leaves out.

    Raises
    ------
    MultiPhiTypeError
        For points of another kind.
    MultiPhiValueError
        For a system without a symmetric linearisation of second order, with coordinates without mass, with joints that
        slide along cables, or whose constraints cannot be met; with strict=True for what would be left out.

    Examples
    --------
    >>> import exudyn as exu
    >>> import exudyn.itemInterface as eii
    >>> import multiphi_exudyn as mp
    >>> from multiphi_exudyn.exudyn_plugin import linear_structure_from, reduce
    >>> container = exu.SystemContainer()
    >>> mbs = container.AddSystem()  # 1 kg on a spring of 4e4 N/m, a stop 1 mm below
    >>> ground = mbs.AddNode(eii.NodePointGround())
    >>> node = mbs.AddNode(eii.Node1D(initialVelocities=[-0.5]))
    >>> mass = mbs.AddObject(eii.ObjectMass1D(name="mass", mass=1.0, nodeNumber=node))
    >>> ends = [
    ...     mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=n, coordinate=0))
    ...     for n in (ground, node)
    ... ]
    >>> spring = mbs.AddObject(
    ...     eii.CoordinateSpringDamper(name="spring", markerNumbers=ends, stiffness=4e4)
    ... )
    >>> data = mbs.AddNode(
    ...     eii.NodeGenericData(initialCoordinates=[1.0], numberOfDataCoordinates=1)
    ... )
    >>> law = {"contactStiffness": 1e6, "offset": -1e-3, "nodeNumber": data}
    >>> stop = mbs.AddObject(
    ...     eii.ObjectContactCoordinate(name="stop", markerNumbers=ends, **law)
    ... )
    >>> mbs.Assemble()
    >>> reduction = reduce(mbs)
    >>> given = {"velocity": reduction.velocity, "loads": reduction.loads}
    >>> tr = mp.simulate(reduction.model, 0.1, **given)
    >>> tr.events[0].contact, tr.events[0].kind
    ('stop', 'close')
    """
    check_system(mbs)
    objects, loads = items_of(mbs)
    now = mbs.systemData.GetTime()  # [s]; the solvers below set it to zero
    with initial_is_current(mbs):
        start = moved_onto_constraints(mbs, objects, now)
        motions = {i: motion for i, motion in start.motions.items() if isinstance(motion, PrescribedMotion)}
        prescribed = np.vstack([np.zeros((0, len(start.shift))), *(motion.directions for motion in motions.values())])
        gaps = {i: contact_distance(mbs, i, item) for i, item in enumerate(objects) if has_contact(item)}
        frictions = {i: _fixed(friction, prescribed) for i, friction in frictions_of(mbs, objects).items()}
        full_contacts: list[UnilateralContact | Friction] = [
            c for i in gaps for c in contacts_of(mbs, i, objects[i], gaps[i])
        ]
        full_contacts += [friction for friction in frictions.values() if isinstance(friction, Friction)]
        full_rows = {c.name: np.asarray(c.direction) for c in full_contacts}
        with without_contacts(mbs, dict(enumerate(objects)), loads):
            varying, forces = timed_loads(mbs, loads, now), timed_forces(mbs, objects, now)
            timed = {i: load for i, load in varying.items() if isinstance(load, TimedLoad)}
            time_loads = (*timed.values(), *forces.values())
            rows_that_push = [*full_rows.values(), *(row for load in time_loads for row in load.rows)]
            linear = linearised(mbs, now, rows_that_push, motions)
        if points is None:
            rows = default_points(mbs, linear.basis, prescribed)
        else:
            rows = requested_points(mbs, points, linear.basis, prescribed)
    if damping is None and np.any(linear.damping):
        damping = linear.damping
    structure = LinearizedStructure(linear.mass, linear.stiffness, damping, rows, coordinates=linear.basis)
    contacts = [replace(c, direction=_project(full_rows[c.name], linear.basis)) for c in full_contacts]
    moving = [c for c in contacts if np.any(structure.row(c.direction))]
    names = {c.name for c in moving}
    taken = (*_with_time_change(taken_objects(objects, names), forces, motions), *_taken_loads(loads, timed))
    left_out = (
        *left_out_objects(
            objects,
            names,
            {i: reason for i, reason in frictions.items() if isinstance(reason, str)},
            {i: motion if isinstance(motion, str) else "" for i, motion in start.motions.items()},
        ),
        *((load_item(i, loads[i]), reason) for i, reason in varying.items() if isinstance(reason, str)),
        *left_out_functions(mbs),
    )
    unmoved = () if linear.unmoved is None else tuple(left_out_directions(linear.unmoved.reason))
    missing = [*missing_parts(left_out), *grouped(unmoved)]
    if strict and missing:
        raise MultiPhiValueError(f"mbs: got what a reduction leaves out ({'; '.join(missing)}), need strict=False")
    linear = replace(linear, contacts={name: full_rows[name] for name in names}, loads=timed, forces=forces)
    linear = replace(linear, shift=float(np.max(np.abs(start.shift))), violated=start.violated)
    linear = replace(linear, spheres=spheres_of(mbs, objects, names))
    validity = LinearRange(mbs, linear, missing, linearised_functions(left_out), grouped(unmoved))
    return Reduction(
        MultiPhiModel(structure, moving, _modes(modes, structure.n - len(moving)), validity=validity),
        linear.basis.T @ (linear.velocity - linear.prescribed(0.0, 1)),
        (
            *([ConstantLoad(linear.static, 1.0)] if np.any(linear.static) else []),
            *(each for load in time_loads for each in function_loads(load, linear.basis)),
            *(each for moved in linear.moved.values() for each in _motion_loads(moved)),
            *(each for contact in moving for each in _stop_motions(contact, full_rows[contact.name], motions)),
        ),
        taken,
        (*left_out, *unmoved),
        linear.symmetrised,
        start.shift,
        linear.prescribed,
    )


def _fixed(friction: Friction | str, prescribed: np.ndarray) -> Friction | str:
    """A friction, or the reason why a prescribed motion of its coordinate leaves it out."""
    if isinstance(friction, Friction) and moved_by(np.asarray(friction.direction), prescribed):
        return "friction on a coordinate that a prescribed motion moves"
    return friction


def _motion_loads(moved: MovedBy) -> Iterator[VaryingLoad]:
    """Loads -S^T K e^T u and -S^T C e^T u' of a prescribed motion."""
    motion = moved.motion
    rates, speed = (RateLoad, motion.value) if motion.speed is None else (FunctionLoad, motion.speed)
    for kind, matrix, values in ((FunctionLoad, moved.stiffness, motion.value), (rates, moved.damping, speed)):
        for column, unit in zip(matrix.T, np.eye(matrix.shape[1]), strict=True):
            if np.any(column):
                yield kind(-column, Component(motion.item, values, unit))


def _stop_motions(
    contact: UnilateralContact | Friction, row: np.ndarray, motions: Mapping[int, PrescribedMotion]
) -> Iterator[StopMotion]:
    """The motion of a contact's stop by each prescribed motion: that of its gap, but opposite."""
    for motion in motions.values():
        if moved_by(row, motion.directions):
            yield StopMotion(contact.name, Smooth(Component(motion.item, motion.value, -motion.directions @ row)))


def _with_time_change(
    items: Iterator[Item], forces: Mapping[int, TimedLoad], motions: Mapping[int, PrescribedMotion]
) -> Iterator[Item]:
    for item in items:
        also = "; how its force changes with time" if item.index in forces else ""
        also += "; the motion that it prescribes" if item.index in motions else ""
        yield replace(item, became=f"{item.became}{also}")


def _taken_loads(loads: list[dict[str, Any]], timed: Mapping[int, TimedLoad]) -> Iterator[Item]:
    for i, load in enumerate(loads):
        if i in timed:
            yield load_item(i, load, "load by its function of time")
        elif not user_function(load):
            direction = " in its present direction" if load.get("bodyFixed", False) else ""
            yield load_item(i, load, f"constant load{direction}")


def _modes(modes: int | str | UpTo | Tolerance | None, most: int) -> int | str | UpTo | Tolerance | None:
    if modes is None:
        return "all" if most <= SMALL else None
    return "all" if isinstance(modes, int) and modes > most else modes


def _project(row: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """A row in z; zero if constraints fix it."""
    projected: np.ndarray = row @ basis
    return projected if np.max(np.abs(projected)) > HELD * np.max(np.abs(row), initial=1.0) else 0 * projected
