"""What a reduction makes of each item of an Exudyn system: taken as what, or left out for which reason."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

from multiphi_exudyn.exudyn_plugin.convert.items import (
    DAMPER_EXT,
    Item,
    has_friction,
    has_stops,
    is_active,
    is_constraint,
    is_contact,
    is_of_spheres,
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
HELD_GAP = "constraints hold its gap"
HELD_GAPS = "constraints hold the gaps of its limit stops"
HELD_FRICTION = "constraints hold the coordinate of its friction"
IDLE = (INACTIVE, HELD_GAP, HELD_GAPS, HELD_FRICTION)  # reasons for which leaving an item out changes no motion
USER_FUNCTION = (
    "the difference of its user function from its tangent at the current state"  # a run's check asks the system for it
)
NAMED = 3  # items of a group that are told by name: enough to find the others
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
    """Objects of the model; contacts: the names of its contacts and frictions."""
    for i, item in enumerate(objects):
        if is_active(item) and (not is_contact(item) or item["name"] in contacts):
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


def left_out_directions(of: str) -> Iterator[tuple[Item, str]]:
    """Directions that are left out because nothing moves the system there; of: what is wrong with them."""
    yield Item("mbs", 0, "MainSystem"), f"directions in which nothing moves it, {of}"


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


def _reason(item: Mapping[str, Any], contacts: Collection[str], friction: str) -> str:
    """Why an object, or a part of it, is left out; empty if it is not."""
    if not is_active(item):
        return INACTIVE
    if is_contact(item) and item["name"] not in contacts:
        return refusal_of(item) or HELD_GAP
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
    if is_contact(item):
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
    return f" and {damping:g} N s/m, which never pulls; Exudyn's pulls where the contact opens" if damping else ""
