"""Items of an Exudyn system, as GetObject and GetLoad tell them, and what a reduction makes of each.

Contacts of a model are ObjectContactCoordinate and ObjectContactSphereSphere, -SphereTriangle and -SphereTorus with a
linear law without friction, and the limit stops of ObjectConnectorCoordinateSpringDamperExt, its friction that of the
latter (frictions.py); everything else is a matrix, a constraint, a load, or left out with a reason.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

__all__ = [
    "Item",
    "grouped",
    "has_contact",
    "has_friction",
    "has_stops",
    "is_constraint",
    "is_curved",
    "is_of_spheres",
    "left_out_functions",
    "left_out_instability",
    "left_out_objects",
    "linearised_functions",
    "load_item",
    "missing_parts",
    "rough_parameters",
    "taken_objects",
    "user_function",
    "value_key",
]

INACTIVE = "not active"
HELD_GAP = "constraints hold its gap"
HELD_GAPS = "constraints hold the gaps of its limit stops"
HELD_FRICTION = "constraints hold the coordinate of its friction"
IDLE = (INACTIVE, HELD_GAP, HELD_GAPS, HELD_FRICTION)  # reasons for which leaving an item out changes no motion
USER_FUNCTION = (
    "how its user function differs from its tangent at the current state"  # which a run's check asks the system for
)
NAMED = 3  # items of a group that are told by name: enough to find the others

_EXT = "ConnectorCoordinateSpringDamperExt"
_FRICTION = ("dynamicFrictionForce", "staticFrictionOffsetForce", "viscousFrictionFactor")
_SPHERES = "ContactSphereSphere"  # what Exudyn calls spheres on spheres, on triangles and on a torus alike
_CONTACT_LAW = {  # of a linear spring on one side
    "impactModel": ("impact model", 0),
    "contactStiffnessExponent": ("stiffness exponent", 1),
    "dynamicFriction": ("friction coefficient", 0),
    "contactPlasticityRatio": ("plasticity ratio", 0),
}
_LINEAR = {"Mass1D", "RotationalMass1D", "MassPoint", "MassPoint2D", "ConnectorCoordinateSpringDamper", _EXT}
_LINEAR |= {"GenericODE2"}
_ONE_SIDED = {
    "ConnectorRollingDiscPenalty": "its contact and its friction away from the current state",
    "ConnectorReevingSystemSprings": "that its rope gets slack",
}
_CONSTRAINTS = ("Joint", "ConnectorDistance")
_COORDINATE_CONSTRAINTS = {"ConnectorCoordinate", "ConnectorCoordinateVector"}


@dataclass(frozen=True)
class Item:
    """One item of an Exudyn system, and what a reduction made of it.

    Attributes
    ----------
    name : str
        Of the item.
    index : int
        Among objects or loads; 0 for the system.
    type : str
        Exudyn's type of it.
    became : str
        What it is in the model; empty where it was left out.

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
    >>> taken = reduce(mbs).taken
    >>> taken[1].name, taken[1].became
    ('spring', 'its matrices')
    """

    name: str
    index: int
    type: str
    became: str = ""


def has_stops(item: Mapping[str, Any]) -> bool:
    """True for an object with limit stops in use."""
    return item["objectType"] == _EXT and item["useLimitStops"] and item["limitStopsStiffness"] > 0


def has_contact(item: Mapping[str, Any]) -> bool:
    """True for an active object that gives the model one contact or two."""
    return _is_active(item) and (has_stops(item) or (_is_contact(item) and not _refusal(item)))


def has_friction(item: Mapping[str, Any]) -> bool:
    """True for an active connector with friction of its own law."""
    rubs = item["objectType"] == _EXT and any(float(item[name]) for name in _FRICTION)
    return rubs and _is_active(item) and not user_function(item)


def is_constraint(item: Mapping[str, Any]) -> bool:
    """True for a joint or another connector that holds coordinates, whatever forces that takes."""
    kind = str(item["objectType"])
    return kind.startswith(_CONSTRAINTS) or kind in _COORDINATE_CONSTRAINTS


def is_of_spheres(item: Mapping[str, Any]) -> bool:
    """True for a contact of a sphere, whose direction is that of its gradient at the current state."""
    return bool(item["objectType"] == _SPHERES)


def is_curved(item: Mapping[str, Any]) -> bool:
    """True for an active constraint that is not linear in the coordinates, whose force gives stiffness."""
    bent = [item.get(key) for key in ("quadraticTermMarker0", "quadraticTermMarker1", "constraintUserFunction")]
    curved = str(item["objectType"]).startswith(_CONSTRAINTS) or any(np.any(term) for term in bent if term is not None)
    return is_constraint(item) and _is_active(item) and curved


def rough_parameters(item: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Parameters that take contact and friction out of an object, and their values without."""
    if _is_contact(item) and _is_active(item):
        return [("activeConnector", False)]
    if item["objectType"] != _EXT:
        return []
    return [("useLimitStops", False), *((name, 0.0) for name in _FRICTION)]


def user_function(item: Mapping[str, Any]) -> str:
    """Key of an item's first user function that is not for graphics, empty without one."""
    keys = (key for key in item if key.endswith(("UserFunction", "UserFunction_t")) and not key.startswith("V"))
    return next((key for key in keys if item[key]), "")


def value_key(load: Mapping[str, Any]) -> str:
    """Key of a load's value."""
    return "load" if "load" in load else "loadVector"


def taken_objects(objects: Sequence[Mapping[str, Any]], contacts: Collection[str]) -> Iterator[Item]:
    """Objects of the model; contacts: the names of its contacts and frictions."""
    for i, item in enumerate(objects):
        if _is_active(item) and (not _is_contact(item) or item["name"] in contacts):
            yield _object_item(i, item, _became(item, contacts))


def left_out_objects(
    objects: Sequence[Mapping[str, Any]], contacts: Collection[str], frictions: Mapping[int, str]
) -> Iterator[tuple[Item, str]]:
    """Objects that are no part of the model, or not as a whole, with the reason; frictions: reasons of theirs."""
    for i, item in enumerate(objects):
        reason = _reason(item, contacts, frictions.get(i, ""))
        if reason:
            yield _object_item(i, item), reason


def left_out_functions(mbs: Any) -> Iterator[tuple[Item, str]]:
    """User functions of the system itself, which may do anything in a run."""
    for kind in ("PreStep", "PostStep", "PostNewton", "PreNewtonResidual"):
        if getattr(mbs, f"Get{kind}UserFunction")():
            yield Item("mbs", 0, f"{kind}UserFunction"), "what it does in a run"


def left_out_instability(where: str) -> Iterator[tuple[Item, str]]:
    """Directions that are held because nothing moves them, though they are unstable; none if ``where`` is empty."""
    if where:
        yield Item("mbs", 0, "MainSystem"), f"an unstable direction {where}, in which nothing moves it"


def grouped(told: Iterable[tuple[Item, str]]) -> list[str]:
    """Sentences "16 ObjectContactCircleCable2D ('a', 'b', ...): ...", one for each type and what is said of it."""
    groups: dict[tuple[str, str], list[str]] = {}
    for item, said in told:
        groups.setdefault((item.type, said), []).append(repr(item.name))
    return [f"{_members(kind, names)}: {said}" for (kind, said), names in groups.items()]


def _members(kind: str, names: Sequence[str]) -> str:
    if len(names) == 1:
        return f"{kind} {names[0]}"
    more = ["..."] if len(names) > NAMED else []
    return f"{len(names)} {kind} ({', '.join([*names[:NAMED], *more])})"


def missing_parts(left_out: Iterable[tuple[Item, str]]) -> list[str]:
    """What a run of the model lacks, grouped; what is switched off or held acts in no run."""
    return grouped((item, reason) for item, reason in left_out if reason not in IDLE)


def linearised_functions(left_out: Iterable[tuple[Item, str]]) -> list[str]:
    """The part of it that the system itself can be asked for at any state, grouped."""
    return grouped((item, reason) for item, reason in left_out if reason == USER_FUNCTION)


def load_item(index: int, load: Mapping[str, Any], became: str = "") -> Item:
    return Item(load["name"], index, f"Load{load['loadType']}", became)


def _object_item(index: int, item: Mapping[str, Any], became: str = "") -> Item:
    return Item(item["name"], index, f"Object{item['objectType']}", became)


def _is_active(item: Mapping[str, Any]) -> bool:
    return bool(item.get("activeConnector", True))


def _is_contact(item: Mapping[str, Any]) -> bool:
    """True for a contact object of any law; limit stops are none."""
    return str(item["objectType"]).startswith("Contact")


def _refusal(item: Mapping[str, Any]) -> str:
    """Why an active contact object is no unilateral spring; empty if it is one."""
    if item["objectType"] not in ("ContactCoordinate", _SPHERES):
        return "its point of contact moves over a surface, so that its gap is no linear function of coordinates"
    for key, (called, needed) in _CONTACT_LAW.items():
        if item.get(key, needed) != needed:
            return f"{called} {item[key]:g}, need {needed}"
    if not item["contactStiffness"] > 0:
        return f"contact stiffness {item['contactStiffness']:g}, need a value > 0"
    return ""


def _reason(item: Mapping[str, Any], contacts: Collection[str], friction: str) -> str:
    """Why an object, or a part of it, is left out; empty if it is not."""
    if not _is_active(item):
        return INACTIVE
    if _is_contact(item) and item["name"] not in contacts:
        return _refusal(item) or HELD_GAP
    if has_stops(item) and not _stops(item, contacts):
        return HELD_GAPS
    if friction:
        return friction
    if has_friction(item) and item["name"] not in contacts:
        return HELD_FRICTION
    if item["objectType"] in _ONE_SIDED:
        return _ONE_SIDED[item["objectType"]]
    if is_constraint(item) and (user_function(item).startswith("offset") or _prescribes_velocity(item)):
        return "the motion it prescribes; its coordinate is held where it is"
    if user_function(item):
        return USER_FUNCTION
    return ""


def _prescribes_velocity(item: Mapping[str, Any]) -> bool:
    return bool(item.get("velocityLevel", False)) and bool(item.get("offset", 0.0))


def _became(item: Mapping[str, Any], contacts: Collection[str]) -> str:
    if _is_contact(item):
        present = ", in its present direction" if is_of_spheres(item) else ""
        return f"contact, {item['contactStiffness']:g} N/m{_damper(item['contactDamping'])}{present}"
    if item["objectType"] == "Ground":
        return "ground"
    if is_constraint(item):
        return "constraint, its directions taken out"
    parts = [_matrices(item)]
    if stops := _stops(item, contacts):
        law = f"{item['limitStopsStiffness']:g} N/m{_damper(item['limitStopsDamping'])}"
        parts.append(f"contacts {', '.join(stops)}, {law}")
    if has_friction(item) and item["name"] in contacts:
        parts.append(f"friction, {item['dynamicFrictionForce']:g} N by a bristle of {item['stickingStiffness']:g} N/m")
    return "; ".join(parts)


def _stops(item: Mapping[str, Any], contacts: Collection[str]) -> list[str]:
    """Names of the contacts that an object's limit stops became."""
    return [name for name in (f"{item['name']}.upper", f"{item['name']}.lower") if name in contacts]


def _matrices(item: Mapping[str, Any]) -> str:
    if user_function(item):
        return "its user function linearised at the current state"
    return "its matrices" if item["objectType"] in _LINEAR else "linearised at the current state"


def _damper(damping: float) -> str:
    return f" and {damping:g} N s/m, which does not pull where it opens as Exudyn's does" if damping else ""
