"""Friction of an Exudyn system: ObjectConnectorCoordinateSpringDamperExt with a bristle, as mp.Friction.

    q = factor1 q_1 - factor0 q_0,   stick: T = k_s (q - s), |T| <= F,   slip: T = F sign(q')

s the bristle's place, k_s stickingStiffness, F dynamicFrictionForce: Friction(limit=F, stiffness=k_s), whatever spring,
damper and limit stops the connector has beside it, if the bristle sticks where the reduction is made, s = q. Everything
else that the connector offers as friction is another law, and left out with its name. (velocityOffset is the damper's.)
A hair of staticFrictionOffsetForce is taken: without one Exudyn's own runs may slip to the wrong side where stick ends.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import exudyn as exu

from multiphi_exudyn.exudyn_plugin.convert.items import has_friction
from multiphi_exudyn.exudyn_plugin.convert.point_rows import coordinate_row
from multiphi_exudyn.mechanics.friction import Friction

__all__ = ["frictions_of"]

HAIR = 1e-3  # of the limit: a static offset so small is a limit of its own, however it falls with the speed
UNSTRETCHED = 1e-9  # of the limit: what a bristle at its place carries by round-off


def frictions_of(mbs: Any, objects: Sequence[Mapping[str, Any]]) -> dict[int, Friction | str]:
    """Active connectors with friction by index, their directions as rows (n_full,), or why one is no Friction."""
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
    """What makes it another law; empty if nothing does."""
    if item["frictionProportionalZone"] != 0:
        return "friction in proportion to slow speeds (frictionProportionalZone), which creeps where it should stick"
    if item["staticFrictionOffsetForce"] > HAIR * item["dynamicFrictionForce"]:
        return "friction that falls with the speed (staticFrictionOffsetForce, exponentialDecayStatic)"
    if item["viscousFrictionFactor"] != 0:
        return "friction that grows with the speed of slip (viscousFrictionFactor)"
    if item["stickingDamping"] != 0:
        return "friction with a damped bristle (stickingDamping)"
    return ""


def _state(mbs: Any, index: int, item: Mapping[str, Any]) -> str:
    """Why its data node is none of a bristle at rest, where the system stands; empty if it is."""
    state, place, _ = mbs.systemData.GetDataCoordinates()[mbs.systemData.GetObjectLTGData(index)]
    if state != 0:
        return f"friction that slips already (data coordinate 0: {state:g}), need a bristle that sticks: 0"
    travel = mbs.GetObjectOutput(exu.ObjectIndex(index), exu.OutputVariableType.Displacement)
    if abs(item["stickingStiffness"] * (travel - place)) > UNSTRETCHED * item["dynamicFrictionForce"]:
        return f"friction with a stretched bristle (data coordinate 1: {place:g}), need its coordinate: {travel:g}"
    return ""
