"""The run record, and what is known of the elements of a model, in new buffers (arrays.py)."""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.arrays import Buffers
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mathematics.least_distance import INDEPENDENT

__all__ = ["describe_elements"]


def describe_elements(buffers: Buffers, model: MultiPhiModel) -> None:
    """Kinds, chains, stiffnesses and directions of all elements, behind the run record."""
    put = buffers.put
    buffers.take("ints", a.RUN_INTS)
    buffers.take("numbers", a.RUN_NUMBERS)
    base, c = model.base, len(model.contacts)
    viscous = base.dampings > 0
    kinds = np.where(np.isinf(base.stiffnesses), a.RIGID, np.where(viscous, a.VISCOUS, a.COMPLIANT))
    kinds[list(model.held)] = a.SLIDING
    chains = np.full(c, -1)
    for number, chain in enumerate(model.chains):
        chains[list(chain)] = number
    limits = np.zeros((2, c))
    for i in model.held:
        if model.contacts[i].rigid:
            limits[:, i] = model.contacts[i].limit, model.contacts[i].most
    lengths = np.linalg.norm(base.directions, axis=0)
    units = base.directions / np.where(lengths > 0, lengths, 1.0)
    given = {
        a.ELEMENTS: c,
        a.COORDINATES: base.modes.count,
        a.WHOLE: int(model.whole),
        a.KINDS: put("ints", kinds),
        a.CHAINS: put("ints", chains),
        a.CHAIN_COUNT: len(model.chains),
        a.STIFFNESSES: put("numbers", np.where(np.isinf(base.stiffnesses), 0.0, base.stiffnesses)),
        a.STRETCHES: put("numbers", [max(state.stretch for state in c.states) for c in model.contacts]),
        a.DIRECTIONS: put("numbers", units.T),
        a.LIMITS: put("numbers", limits[0]),
        a.STATIC_LIMITS: put("numbers", limits[1]),
        a.RESTITUTIONS: put("numbers", [getattr(element, "restitution", 0.0) for element in model.contacts]),
    }
    for slot, value in given.items():
        buffers.ints[slot] = value
    buffers.numbers[a.INDEPENDENCE] = INDEPENDENT
