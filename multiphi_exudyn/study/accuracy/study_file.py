"""The format of a study file: a scene, what is varied in it, the methods to judge, and how.

A *field* is a place in a scene file, written with dots ("start.displacement", "contacts.*.gap", "loads.0.frequency_hz";
:mod:`multiphi_exudyn.study.scene`); its values may be whole tables. A *setting* is one choice of a method's
own fields (modes, elements, step ...); a method's settings are the Cartesian product of its axes. Where a setting can
be lucky (micro-bounces are sampled differently by every step) it is run at *nearby* values too, and the worst counts.
Errors of mesh and step can cancel for a whole range of steps, and few modes be right by chance: a setting *lasts* where
every finer one holds as well, with a smaller step or tolerance, or with more modes or elements.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from multiphi_exudyn.study.scene_tables import Finite, Positive, Table

__all__ = ["COARSER", "REFERENCE", "BudgetSpec", "MethodSpec", "QuickSpec", "StudyFile", "is_number"]

REFERENCE, COARSER = "reference", "coarser"  # methods of their own in every study

Value = Annotated[int, Field(strict=True)] | Finite | str | bool | dict[str, Any] | list[Any]
Values = Annotated[tuple[Value, ...], Field(min_length=1)]
Factors = Annotated[tuple[Positive, ...], Field(min_length=1)]


class MethodSpec(Table):
    """One method: a model as in a scene file (without a name), and the axes of its settings."""

    name: Annotated[str, Field(min_length=1)]
    model: dict[str, Any]  # as an entry of models in a scene
    axes: dict[str, Values] = Field(default_factory=dict)  # field of the model -> values, in every combination
    nearby: dict[str, Factors] = Field(default_factory=dict)  # field -> factors on its value
    refine: str | None = None  # its field in which all finer settings have to hold too: a smaller step, more modes
    quick: dict[str, Values] = Field(default_factory=dict)  # axes of the short form, in place of those of the same name


class BudgetSpec(Table):
    """The ladder from the full model to the reduced one, one run a rung."""

    modes: Annotated[int, Field(ge=1)] = 6  # of the truncated models


class QuickSpec(Table):
    """What the short form of a study changes."""

    change: dict[str, Any] = Field(default_factory=dict)  # field of the scene -> value
    axes: dict[str, Values] = Field(default_factory=dict)  # place in the scene -> values, in place of the same axis


class StudyFile(Table):
    """A whole study file.

    scene: a shipped scene or a TOML file beside the study. change: field -> value, for all runs. axes: field -> values;
    every method runs at every combination of them. reference, coarser: models that take the place of the scene's own
    reference and its coarser copy; a reference without a copy has no uncertainty.
    window [s]: the errors that are ranked are those from 0 to here. tolerances: for which the cheapest settings are
    looked up. time_limit_s: of one run, wall clock. timing: whether settings are timed, alone on the machine.
    histories: keep those of every run. maps: methods whose time-frequency maps are drawn, each at its most accurate
    setting, beside the reference's.
    """

    title: Annotated[str, Field(min_length=1)]  # the heading of its report
    scene: str  # a shipped scene, or a TOML file beside the study
    change: dict[str, Any] = Field(default_factory=dict)  # field of the scene -> value, for all runs
    axes: dict[str, Values] = Field(default_factory=dict)  # place in the scene -> values
    reference: dict[str, Any] | None = None
    coarser: dict[str, Any] | None = None
    methods: tuple[MethodSpec, ...] = ()
    budget: BudgetSpec | None = None
    window: Positive | None = None  # s; errors are ranked from 0 to here
    tolerances: Annotated[tuple[Positive, ...], Field(min_length=1)] = (0.1, 0.05, 0.02, 0.01)
    time_limit_s: Positive = 300.0  # s, wall clock of one run
    timing: bool = True
    histories: bool = False
    maps: tuple[str, ...] = ()
    quick: QuickSpec = QuickSpec()


def is_number(value: Any) -> bool:
    """Whether a field's value is a number, and not True or False."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)
