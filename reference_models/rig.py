"""The published test rig: known data, published tables, identified parameter sets and assumptions.

Everything numeric stands in ``rig.toml`` beside this file, with its source; here it becomes a ``Beam``, a
``UnilateralContact`` and damping ratios. SI units, frequencies in Hz, ratios as fractions of the critical.

A parameter set is one of ``PARAMETER_SETS``. ``as-published`` has the shapes of ``measured-free`` and the
printed frequencies and ratios of both levels (``published_override``): it mixes two systems, and says so.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import Any

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.beam import Beam, Clamp, PointMass, Section
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.damping import ModalDamping

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = [
    "PARAMETER_SETS",
    "ParameterSet",
    "PublishedLevel",
    "Rig",
    "assumptions",
    "identified_set",
    "initial_displacement",
    "published_frequencies",
    "published_override",
    "rig",
    "rig_beam",
    "rig_contact",
    "rig_damping",
]

PARAMETER_SETS = ("measured-free", "printed-pinned", "as-published")
HOLES = ("hole1", "hole2", "hole3")
CONTACT = "support"
RIGID_CLAMP = Clamp()


@dataclass(frozen=True)
class PublishedLevel:
    """One column of a published table.

    level: the names of the contacts closed in it. frequencies [Hz], ratios (empty where none are printed).
    """

    source: str
    level: tuple[str, ...]
    frequencies: tuple[float, ...]
    ratios: tuple[float, ...]
    note: str


@dataclass(frozen=True)
class Rig:
    """What the paper's text gives; positions [m] from the clamp.

    contradiction: why the two columns of Table 38.2 cannot belong to one linear model.
    """

    paper: str
    youngs_modulus: float
    density: float
    tip_mass: float
    tip_mass_position: float
    contact_gap: float
    degrees_of_freedom: int
    points: Mapping[str, float]
    contradiction: str


@dataclass(frozen=True)
class ParameterSet:
    """Identified here, not printed: a prismatic rectangle [m] and the tip's inertia [kg m2]."""

    width: float
    height: float
    length: float
    tip_inertia: float
    fitted_to: str


def rig() -> Rig:
    """The rig as far as the paper's text describes it."""
    data = _data()
    known = {key: value for key, value in data["known"].items() if key in Rig.__dataclass_fields__}
    known["points"] = MappingProxyType(dict(data["known"]["points"]))
    return Rig(paper=data["source"]["paper"], contradiction=data["published"]["contradiction"]["statement"], **known)


def published_frequencies() -> Mapping[str, PublishedLevel]:
    """Tables 38.1 (``measured``) and 38.2 (``clamped_free``, ``clamped_pinned``), as printed."""
    return MappingProxyType({name: _level(name) for name in ("measured", "clamped_free", "clamped_pinned")})


def published_override(parameter_set: str = "as-published") -> Mapping[tuple[str, ...], PublishedLevel]:
    """Frequencies and ratios replacing a level's own, by its closed contacts; only ``as-published`` has any.

    The clamped-pinned ratios in it are assumed: the paper prints none.
    """
    assumed = tuple(_assumed_values(parameter_set).get("closed_ratios", ()))
    levels = [_level(name) for name in _set(parameter_set).get("overrides", ())]
    return MappingProxyType({level.level: replace(level, ratios=level.ratios or assumed) for level in levels})


def identified_set(parameter_set: str = "measured-free") -> ParameterSet:
    """Section and tip inertia of a set; ``as-published`` has those of the set whose shapes it uses."""
    given = _set(parameter_set)
    return ParameterSet(**_set(given.get("shapes_of", parameter_set)))


def rig_beam(parameter_set: str = "measured-free", clamp: Clamp = RIGID_CLAMP) -> Beam:
    """The beam with its tip mass and the points node1 to node3 and hole1 to hole3 (nearest the tip).

    clamp: ideally rigid in the paper, which names its flexibility as the first open point.
    """
    known, given = rig(), identified_set(parameter_set)
    values = _assumed_values(parameter_set)
    section = Section.rectangle(
        0.0,
        given.length,
        width=given.width,
        height=given.height,
        youngs_modulus=known.youngs_modulus,
        density=known.density,
        poisson_ratio=values["poisson_ratio"],
    )
    points = {**known.points, **{hole: values[hole] for hole in HOLES}}
    return Beam([section], points, [PointMass(known.tip_mass_position, known.tip_mass, given.tip_inertia)], clamp)


def rig_contact(stiffness: float = math.inf) -> UnilateralContact:
    """The support below node2, ideally rigid in the paper; stiffness [N/m]."""
    return UnilateralContact(CONTACT, "node2", rig().contact_gap, stiffness)


def rig_damping() -> ModalDamping:
    """The measured ratios of the clamped-free modes; those above the fourth have the fourth's (assumed)."""
    return ModalDamping(_level("measured").ratios, beyond=_assumed_values("measured-free")["ratio_beyond"])


def initial_displacement() -> float:
    """Assumed static displacement of node3 before the release [m], without its sign."""
    return _assumed_values("measured-free")["initial_displacement"]


def assumptions(parameter_set: str = "measured-free", clamp: Clamp = RIGID_CLAMP) -> tuple[str, ...]:
    """What a run with this set and clamp rests on beyond the paper, one sentence each, for reports."""
    numbers = _printed(identified_set(parameter_set)) | {"clamp": _clamp_words(clamp)}
    listed = [
        f"{entry['quantity']}: {entry['text'].format(**numbers)} (assumed: {entry['reason']})"
        for entry in _assumed(parameter_set)
    ]
    return (_headline(parameter_set), *listed, rig().contradiction)


@cache
def _data() -> dict[str, Any]:
    return tomllib.loads((files("reference_models") / "rig.toml").read_text(encoding="utf-8"))


def _set(name: str) -> dict[str, Any]:
    if name not in PARAMETER_SETS:
        raise MultiPhiValueError(f"parameter_set: got {name!r}, need one of: {', '.join(PARAMETER_SETS)}")
    return _data()["sets"][name]


def _clamp_words(clamp: Clamp) -> str:
    stiffnesses = {"translation": (clamp.translation, "N/m"), "rotation": (clamp.rotation, "N m/rad")}
    elastic = [f"{value:g} {unit} in {name}" for name, (value, unit) in stiffnesses.items() if math.isfinite(value)]
    return f"elastic, {' and '.join(elastic)}" if elastic else "ideally rigid"


def _printed(numbers: ParameterSet) -> dict[str, Any]:
    millimetres = {f"{name}_mm": 1e3 * getattr(numbers, name) for name in ("width", "height", "length")}
    return {**millimetres, "tip_inertia": numbers.tip_inertia}


def _headline(parameter_set: str) -> str:
    given, fitted_to = _set(parameter_set), identified_set(parameter_set).fitted_to
    if "shapes_of" not in given:
        return f"parameter set {parameter_set}: fitted to the {fitted_to}"
    return (
        f"parameter set {parameter_set}: {given['caution']}; shapes of {given['shapes_of']}, fitted to the {fitted_to}"
    )


def _level(name: str) -> PublishedLevel:
    table = _data()["published"][name]
    return PublishedLevel(
        table["source"],
        tuple(table["level"]),
        tuple(table["frequencies"]),
        tuple(table["ratios"]),
        table["note"],
    )


def _assumed(parameter_set: str) -> list[dict[str, Any]]:
    return [entry for entry in _data()["assumed"] if parameter_set in entry.get("sets", PARAMETER_SETS)]


def _assumed_values(parameter_set: str) -> dict[str, Any]:
    return {key: value for entry in _assumed(parameter_set) for key, value in entry.get("values", {}).items()}
