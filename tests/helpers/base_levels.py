"""Levels of a base by themselves, without the loads and the number of modes of a model."""

import multiphi_exudyn._core as core
from multiphi_exudyn.levels.level.level import Level


def build_level(base, links, modes=None):
    """The level with these links closed and its lowest ``modes`` modes, all of them for None."""
    return Level(base, core.MovingLevel(base.core_base, list(links), core.KeptModes(modes)))


def static_response(base, closed, load, gaps=None):
    """Forces (k,) of closed links and y (m,) under a load (m,), with their own gaps or others (k,)."""
    return core.static_response(base.core_base, list(closed), base.gaps[list(closed)] if gaps is None else gaps, load)
