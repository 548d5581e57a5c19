"""Core model: a model as the core takes it, its base and its elements, made once for every model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.element import Element, ElementState, Exit, friction_spring
from multiphi_exudyn.mechanics.friction import Friction

__all__ = ["core_model"]

ENTRY = "core model"  # its key among the entries of a model
RULES = (  # in the order of the numbers in element.py
    core.Rule.may_recover,
    core.Rule.never_recovers,
    core.Rule.always_taken,
    core.Rule.taken_once,
    core.Rule.taken_falling,
)


@dataclass(frozen=True)
class _Kept:
    """A core model among the entries of a model."""

    made: core.Model

    def __reduce__(self) -> tuple[Any, ...]:
        return type(None), ()  # a copy of the model makes its own


def core_model(model: MultiPhiModel) -> core.Model:
    """Return the core's model, which the model keeps."""
    kept: _Kept = model.entries.get_or_build(ENTRY, lambda: _Kept(_made(model)))
    return kept.made


def _made(model: MultiPhiModel) -> core.Model:
    base = model.base
    elements = [_element(model, i) for i in range(len(model.contacts))]
    rough = np.array([_coefficients(element) for element in model.contacts]).reshape(-1, 2)
    return core.Model(
        levels=model.modal_levels,
        gaps=base.gaps,
        elements=elements,
        roughest_first=np.lexsort((-rough[:, 0], -rough[:, 1])).tolist(),
        is_complete=model.whole,
        knots=sum(len(law.further) for law in base.laws.values()),
    )


def _element(model: MultiPhiModel, i: int) -> core.Element:
    element, links, law = model.contacts[i], model.link_indices[i], model.base.laws.get(i)
    state, number, spring, drop = friction_spring(element)
    limit, static_limit = _limits(element)
    friction, static_friction = _coefficients(element)
    return core.Element(
        kind=_kind(element),
        links=links,
        states=[_state(element, links, each) for each in element.states],
        stiffness=0.0 if math.isinf(element.stiffness) else element.stiffness,
        restitution=getattr(element, "restitution", 0.0),
        limit=limit,
        static_limit=static_limit,
        friction=friction,
        static_friction=static_friction,
        knots=(links[1], *law.knot_counts) if law is not None and law.further else (0, 0, 0),
        stick=(state, links[number], spring, drop),
    )


def _kind(element: Element) -> core.Kind:
    if element.held:
        return core.Kind.sliding
    if element.rigid:
        return core.Kind.rigid
    if isinstance(element, UnilateralContact) and element.bounded:
        return core.Kind.bounded
    return core.Kind.viscous if element.damping > 0 else core.Kind.compliant


def _limits(element: Element) -> tuple[float, float]:
    """Return the limits of friction without a tangential spring: forces [N], or ratios to the force of a contact."""
    if isinstance(element, Friction) and element.rigid:
        return element.limit, element.most
    if isinstance(element, UnilateralContact) and not element.rigid and math.isinf(element.tangential_stiffness):
        return element.friction, element.most
    return 0.0, 0.0


def _coefficients(element: Element) -> tuple[float, float]:
    """Return the coefficients of friction of a rigid contact, else zeros."""
    if isinstance(element, UnilateralContact) and element.rigid:
        return element.friction, element.most
    return 0.0, 0.0


def _state(element: Element, links: tuple[int, ...], state: ElementState) -> core.ElementState:
    return core.ElementState(
        guards=[_guard(element, links, exit_) for exit_ in state.exits],
        links=[links[number] for number in state.holds],
        force=state.push,
        stretch=state.stretch,
        ratio=None if state.rubs is None else (links[state.rubs[0]], state.rubs[1]),
    )


def _guard(element: Element, links: tuple[int, ...], exit_: Exit) -> core.GuardForm:
    numbers = {state.name: number for number, state in enumerate(element.states)}
    turn = exit_.turn
    return core.GuardForm(
        target=numbers[exit_.asked],
        rule=RULES[exit_.firmness],
        constant=exit_.constant,
        shares=[(links[share.link], share.gap, share.rate, share.force) for share in exit_.shares],
        by_velocity=None if turn is None else (links[turn.link], numbers[turn.forward], numbers[turn.backward]),
    )
