"""Item fates: the part of each item of an Exudyn system in a reduced model, or the reason why it is left out."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from multiphi_exudyn.exudyn_plugin.convert.items.items import (
    DAMPER_EXT,
    Item,
    has_friction,
    has_limit_stops,
    is_active,
    is_constraint,
    is_contact,
    is_sphere_contact,
    refusal_of,
    user_function,
)

__all__ = [
    "grouped",
    "left_out_directions",
    "left_out_functions",
    "left_out_objects",
    "linearised_functions",
    "load_item",
    "missing_parts",
    "taken_objects",
]

INACTIVE = "not active"
FIXED_GAP = "constraints hold its gap"
FIXED_GAPS = "constraints hold the gaps of its limit stops"
FIXED_FRICTION = "constraints hold the coordinate of its friction"
WITHOUT_EFFECT = (INACTIVE, FIXED_GAP, FIXED_GAPS, FIXED_FRICTION)  # reasons of items that have no effect on a motion
USER_FUNCTION = (
    "the difference of its user function from its tangent at the current state"  # evaluated by the check of a run
)
NAMES_SHOWN = 3  # names of items that are shown for a group
_LINEAR = {
    "GenericODE2",
    "Mass1D",
    "RotationalMass1D",
    "MassPoint",
    "MassPoint2D",
    "ConnectorCoordinateSpringDamper",
    DAMPER_EXT,
}
_ONE_SIDED = {
    "ConnectorRollingDiscPenalty": "its contact and its friction away from the current state",
    "ConnectorReevingSystemSprings": "slackening of its rope",
}


def taken_objects(objects: Sequence[Mapping[str, Any]], contacts: Collection[str]) -> Iterator[Item]:
    """Objects that are part of the model; contacts: names of its contacts and frictions."""
    for i, item in enumerate(objects):
        if is_active(item) and (not is_contact(item) or item["name"] in contacts):
            yield _object_item(i, item, _role(item, contacts))


def left_out_objects(
    objects: Sequence[Mapping[str, Any]],
    contacts: Collection[str],
    frictions: Mapping[int, str],
    motions: Mapping[int, str],
) -> Iterator[tuple[Item, str]]:
    """Objects that the model does not contain, or not completely, with the reason.

    frictions, motions: reasons why friction or a prescribed motion is left out, empty for a motion that is taken.
    """
    for i, item in enumerate(objects):
        reason = _reason(item, contacts, frictions.get(i, ""), motions.get(i))
        if reason:
            yield _object_item(i, item), reason


def left_out_functions(mbs: Any) -> Iterator[tuple[Item, str]]:
    """User functions of the system itself, whose effect on a run is unknown."""
    for kind in ("PreStep", "PostStep", "PostNewton", "PreNewtonResidual"):
        if getattr(mbs, f"Get{kind}UserFunction")():
            yield Item("mbs", 0, f"{kind}UserFunction"), "what it does in a run"


def left_out_directions(reason: str) -> Iterator[tuple[Item, str]]:
    """Directions that are left out because nothing moves the system there; reason: why a structure cannot have them."""
    yield Item("mbs", 0, "MainSystem"), f"directions in which nothing moves it, {reason}"


def grouped(items: Iterable[tuple[Item, str]]) -> list[str]:
    """Sentences "16 ObjectContactCircleCable2D ('a', 'b', ...): ...", one for each type of item and text."""
    groups: dict[tuple[str, str], list[str]] = {}
    for item, text in items:
        groups.setdefault((item.type, text), []).append(repr(item.name))
    return [f"{_members(kind, names)}: {text}" for (kind, text), names in groups.items()]


def _members(kind: str, names: Sequence[str]) -> str:
    if len(names) == 1:
        return f"{kind} {names[0]}"
    more = ["..."] if len(names) > NAMES_SHOWN else []
    return f"{len(names)} {kind} ({', '.join([*names[:NAMES_SHOWN], *more])})"


def missing_parts(left_out: Iterable[tuple[Item, str]]) -> list[str]:
    """Parts of the system that a run of the model lacks, grouped; without those that have no effect."""
    return grouped((item, reason) for item, reason in left_out if reason not in WITHOUT_EFFECT)


def linearised_functions(left_out: Iterable[tuple[Item, str]]) -> list[str]:
    """Those of the missing parts that can be evaluated in the system at any state, grouped."""
    return grouped((item, reason) for item, reason in left_out if reason == USER_FUNCTION)


def load_item(index: int, load: Mapping[str, Any], became: str = "") -> Item:
    return Item(load["name"], index, f"Load{load['loadType']}", became)


def _object_item(index: int, item: Mapping[str, Any], became: str = "") -> Item:
    return Item(item["name"], index, f"Object{item['objectType']}", became)


def _reason(item: Mapping[str, Any], contacts: Collection[str], friction: str, motion: str | None) -> str:
    """Reason why an object, or a part of it, is left out; empty if it is not."""
    if not is_active(item):
        return INACTIVE
    if is_contact(item) and item["name"] not in contacts:
        return refusal_of(item) or FIXED_GAP
    if has_limit_stops(item) and not _stops(item, contacts):
        return FIXED_GAPS
    if friction:
        return friction
    if has_friction(item) and item["name"] not in contacts:
        return FIXED_FRICTION
    if item["objectType"] in _ONE_SIDED:
        return _ONE_SIDED[item["objectType"]]
    if motion == "":
        return ""
    if motion is not None or (is_constraint(item) and _prescribes_velocity(item)):
        return f"the motion it prescribes{f', {motion}' if motion else ''}; its coordinate is held where it is"
    if user_function(item):
        return USER_FUNCTION
    return ""


def _prescribes_velocity(item: Mapping[str, Any]) -> bool:
    return bool(item.get("velocityLevel", False)) and bool(np.any(item.get("offset", 0.0)))


def _role(item: Mapping[str, Any], contacts: Collection[str]) -> str:
    if is_contact(item):
        present = ", in its present direction" if is_sphere_contact(item) else ""
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
    """Names of the contacts of the model from an object's limit stops."""
    return [name for name in (f"{item['name']}.upper", f"{item['name']}.lower") if name in contacts]


def _matrices(item: Mapping[str, Any]) -> str:
    if user_function(item):
        return "its user function linearised at the current state"
    return "its matrices" if item["objectType"] in _LINEAR else "linearised at the current state"


def _damper(damping: float) -> str:
    return f" and {damping:g} N s/m, which never pulls; Exudyn's pulls where the contact opens" if damping else ""
