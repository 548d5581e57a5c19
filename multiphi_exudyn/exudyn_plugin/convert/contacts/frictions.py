"""Friction of an Exudyn system: ObjectConnectorCoordinateSpringDamperExt with a bristle, as mp.Friction.

    q = factor1 q_1 - factor0 q_0,   stick: T = k_s (q - s), |T| <= F,   slip: T = F sign(q')

s is the bristle's position, k_s stickingStiffness, F dynamicFrictionForce. The element is Friction(limit=F,
stiffness=k_s), if the bristle sticks without stretch in the state of the reduction, s = q; the connector may have a
spring, a damper and limit stops as well. Other friction of this connector has another law, and is left out with its
name. (velocityOffset belongs to the damper.) A very small staticFrictionOffsetForce is allowed: without one, Exudyn's
own runs may slip in the wrong direction when stick ends.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import exudyn as exu

from multiphi_exudyn.exudyn_plugin.convert.contacts.point_rows import coordinate_row
from multiphi_exudyn.exudyn_plugin.convert.items.items import has_friction
from multiphi_exudyn.mechanics.elements.friction import Friction

__all__ = ["frictions_of"]

SMALL_OFFSET = 1e-3  # of the limit: a smaller static offset is part of the static limit, at any speed
UNSTRETCHED = 1e-9  # of the limit: a smaller bristle force is round-off


def frictions_of(mbs: Any, objects: Sequence[Mapping[str, Any]]) -> dict[int, Friction | str]:
    """Frictions of active connectors by index, directions as rows (n_full,), or the reason why one has another law."""
    return {i: _friction(mbs, i, item) for i, item in enumerate(objects) if has_friction(item)}


def _friction(mbs: Any, index: int, item: Mapping[str, Any]) -> Friction | str:
    refusal = _law(item) or _state(mbs, index, item)
    if refusal:
        return refusal
    first, second = (coordinate_row(mbs, exu.MarkerIndex(m)) for m in item["markerNumbers"])
    row = item["factor1"] * second - item["factor0"] * first
    limit = item["dynamicFrictionForce"]
    return Friction(item["name"], row, limit, limit + item["staticFrictionOffsetForce"], item["stickingStiffness"])


def _law(item: Mapping[str, Any]) -> str:
    """Reason why the law differs from that of Friction; empty if it does not."""
    if item["frictionProportionalZone"] != 0:
        return "friction in proportion to slow speeds (frictionProportionalZone), which creeps where it should stick"
    if item["staticFrictionOffsetForce"] > SMALL_OFFSET * item["dynamicFrictionForce"]:
        return "friction that falls with the speed (staticFrictionOffsetForce, exponentialDecayStatic)"
    if item["viscousFrictionFactor"] != 0:
        return "friction that grows with the speed of slip (viscousFrictionFactor)"
    if item["stickingDamping"] != 0:
        return "friction with a damped bristle (stickingDamping)"
    return ""


def _state(mbs: Any, index: int, item: Mapping[str, Any]) -> str:
    """Reason why the bristle slips or is stretched in the current state; empty if it does not."""
    state, position, _ = mbs.systemData.GetDataCoordinates()[mbs.systemData.GetObjectLTGData(index)]
    if state != 0:
        return f"friction that slips already (data coordinate 0: {state:g}), need a bristle that sticks: 0"
    travel = mbs.GetObjectOutput(exu.ObjectIndex(index), exu.OutputVariableType.Displacement)
    if abs(item["stickingStiffness"] * (travel - position)) > UNSTRETCHED * item["dynamicFrictionForce"]:
        return f"friction with a stretched bristle (data coordinate 1: {position:g}), need its coordinate: {travel:g}"
    return ""
