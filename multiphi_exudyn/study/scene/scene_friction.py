"""The tables ``[[friction]]`` of a scene file as friction of multiphi_exudyn.mechanics.friction, and in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.study.scene.fields import place_in_words
from multiphi_exudyn.study.scene.scene_file import FrictionSpec
from multiphi_exudyn.study.scene.scenes import Scene, refuse

__all__ = ["check_friction", "described_friction", "friction_of"]


def friction_of(spec: FrictionSpec) -> Friction:
    """The friction of a table; raises the errors of Friction."""
    return Friction(**spec.model_dump())


def described_friction(scene: Scene) -> tuple[str, ...]:
    """Every friction in words, as parts of a sentence."""
    return tuple(
        f"the friction {spec.name} at {place_in_words(spec.direction)} (at most {spec.limit:g} N, {_spring(spec)})"
        for spec in scene.file.friction
    )


def check_friction(scene: Scene, taken: Sequence[str], frictions: Sequence[Friction]) -> None:
    """Names of their own beside those ``taken``; or the field's error."""
    names = list(taken)
    for i, friction in enumerate(frictions):
        if friction.name in names:
            needed = "another name for each contact, force law and friction"
            refuse(scene, f"friction[{i}].name", friction.name, needed)
        names.append(friction.name)


def _spring(spec: FrictionSpec) -> str:
    return "without a spring" if math.isinf(spec.stiffness) else f"a spring of {spec.stiffness:g} N/m in series"
