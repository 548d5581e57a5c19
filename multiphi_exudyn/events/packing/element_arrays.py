"""Run record and data of the elements of a model, in new buffers (arrays.py)."""

from __future__ import annotations

import math

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.arrays import Buffers
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.round_off import INDEPENDENT
from multiphi_exudyn.mechanics.elements.contact import UnilateralContact
from multiphi_exudyn.mechanics.elements.element import friction_spring
from multiphi_exudyn.mechanics.elements.friction import Friction

__all__ = ["describe_elements"]


def describe_elements(buffers: Buffers, model: MultiPhiModel) -> None:
    """Write kinds, stiffnesses, directions and springs of all elements, behind the run record."""
    put = buffers.put
    buffers.take("ints", a.RUN_INTS)
    buffers.take("numbers", a.RUN_NUMBERS)
    base, c = model.base, len(model.contacts)
    viscous = base.dampings > 0
    kinds = np.where(np.isinf(base.stiffnesses), a.RIGID, np.where(viscous, a.VISCOUS, a.COMPLIANT))[:c]
    kinds[[i for i in model.held if i < c]] = a.SLIDING
    segments = np.zeros((c, 3), int)
    for i, law in base.laws.items():
        if law.further:
            segments[i] = base.link_indices[i][1], *law.knot_counts
    limits, rough = np.zeros((2, c)), np.zeros((2, c))
    for i, element in enumerate(model.contacts):
        if isinstance(element, Friction) and element.rigid:
            limits[:, i] = element.limit, element.most
        if isinstance(element, UnilateralContact):
            table = rough if element.rigid else limits if math.isinf(element.tangential_stiffness) else np.zeros((2, c))
            table[:, i] = element.friction, element.most
    lengths = np.linalg.norm(base.directions, axis=0)
    units = base.directions / np.where(lengths > 0, lengths, 1.0)
    slots = {
        a.ELEMENTS: c,
        a.COORDINATES: base.modes.count,
        a.WHOLE: int(model.whole),
        a.JUDGED: int(not model.whole),
        a.KINDS: put("ints", kinds),
        a.UNMOVED: buffers.take("ints", c),
        a.SEGMENTS: put("ints", segments),
        a.KNOTS: sum(len(law.further) for law in base.laws.values()),
        a.STIFFNESSES: put("numbers", np.where(np.isinf(base.stiffnesses), 0.0, base.stiffnesses)[:c]),
        a.DIRECTIONS: put("numbers", units.T),
        a.LIMITS: put("numbers", limits[0]),
        a.STATIC_LIMITS: put("numbers", limits[1]),
        a.FRICTIONS: put("numbers", rough[0]),
        a.STATIC_FRICTIONS: put("numbers", rough[1]),
        a.ROUGHEST_FIRST: put("ints", np.lexsort((-rough[0], -rough[1]))),
        a.RESTITUTIONS: put("numbers", [getattr(element, "restitution", 0.0) for element in model.contacts]),
        **_frictions(buffers, model),
    }
    for slot, value in slots.items():
        buffers.ints[slot] = value
    buffers.numbers[a.INDEPENDENCE] = INDEPENDENT


def _frictions(buffers: Buffers, model: MultiPhiModel) -> dict[int, int]:
    """Write the tangential springs of the elements with a held link."""
    springs = np.array([friction_spring(element) for element in model.contacts]).reshape(-1, 4)
    places = [links[int(row[1])] for links, row in zip(model.link_indices, springs, strict=True)]
    return {
        a.STICKS: buffers.put("ints", springs[:, 0]),
        a.HELD_LINKS: buffers.put("ints", places),
        a.SPRINGS: buffers.put("numbers", springs[:, 2]),
        a.DROPS: buffers.put("numbers", springs[:, 3]),
    }
