"""The force laws of a scene file as force laws of multiphi_exudyn.mechanics.force_law, and in words."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.study.scene.fields import place_in_words
from multiphi_exudyn.study.scene.law_tables import CubicLawSpec, HertzLawSpec, LawSpec, TableLawSpec
from multiphi_exudyn.study.scene.scenes import Scene, refuse

__all__ = ["check_laws", "described_laws", "law_of"]


def law_of(spec: LawSpec) -> ForceLaw:
    """The law of a table; raises the errors of ForceLaw."""
    if isinstance(spec, TableLawSpec):
        return ForceLaw(spec.at, (spec.q, spec.force), name=spec.name)
    return ForceLaw(spec.at, _shape(spec), spec.tolerance, spec.name, spec.span, spec.segments)


def described_laws(scene: Scene) -> tuple[str, ...]:
    """Every law in words, as parts of a sentence."""
    return tuple(
        f"the force law {spec.name} at {place_in_words(spec.at)} ({_form(spec)})" for spec in scene.file.force_laws
    )


def check_laws(scene: Scene, contacts: Sequence[UnilateralContact], laws: Sequence[ForceLaw]) -> None:
    """Names of their own, or the field's error."""
    names = [contact.name for contact in contacts]
    for i, law in enumerate(laws):
        if law.name in names:
            refuse(scene, f"force_laws[{i}].name", law.name, f"another name: there is a {law.name} already")
        names.append(law.name)


def _shape(spec: LawSpec) -> Any:
    """F [N] of q [m], of a number or of an array."""
    if isinstance(spec, CubicLawSpec):
        return partial(_cubic, k1=spec.k1, k3=spec.k3)
    if isinstance(spec, HertzLawSpec):
        return partial(_hertz, stiffness=spec.stiffness, gap=spec.gap, exponent=spec.exponent)
    assert not isinstance(spec, TableLawSpec), "a table has no shape"
    return partial(_magnet, strength=spec.strength, distance=spec.distance)


def _cubic(q: Any, k1: float, k3: float) -> Any:
    return k1 * q + k3 * q**3


def _hertz(q: Any, stiffness: float, gap: float, exponent: float) -> Any:
    return -stiffness * np.maximum(-q - gap, 0.0) ** exponent


def _magnet(q: Any, strength: float, distance: float) -> Any:
    return -strength * np.sign(distance - q) / (distance - q) ** 2


def _form(spec: LawSpec) -> str:
    if isinstance(spec, TableLawSpec):
        return f"a table of {len(spec.q)} places"
    if isinstance(spec, CubicLawSpec):
        return f"{spec.k1:g} N/m q {spec.k3:+g} N/m³ q³"
    if isinstance(spec, HertzLawSpec):
        return f"{spec.stiffness:g} N/m^{spec.exponent:g} beyond a gap of {1e3 * spec.gap:g} mm"
    return f"a magnet of {spec.strength:g} N m² at {1e3 * spec.distance:+g} mm"
