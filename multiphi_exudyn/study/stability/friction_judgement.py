"""Judgement of friction along a native trajectory: force, slip and their events, each found in another way.

way     |h.x - v t - T / k - (the same at the start) - slip| [m], without a spring T / k is zero
force   sticks: |T| - static limit;   slips: | |T| - limit |;   T against the slip: |T|;   as a share of the limit
missed  links that begin or cease to hold between segments without an event
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.study.stability.brute_force import SegmentTable, untold_switches
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["FrictionFound", "judge_friction"]

ROUND_OFF = 1e-14  # of the largest way of a point that rubs, which a stiff spring makes a force
MOVED = 1e-9  # of the largest way of a point that rubs: a smaller slip between two samples has no direction


@dataclass(frozen=True)
class FrictionFound:
    """See the module's docstring: way [m], force as a share of the limit, missed."""

    way: float
    force: float
    missed: int


def judge_friction(trajectory: Trajectory, friction: Friction, table: SegmentTable, times: np.ndarray) -> FrictionFound:
    """One friction at times (k,) [s]."""
    name, i = friction.name, trajectory.model.index(friction.name)
    tension = np.asarray(trajectory.friction_force(name, times))
    slip, place = np.asarray(trajectory.slip(name, times)), np.asarray(trajectory.at(friction.direction, times))
    patch = place - friction.velocity * times - tension / friction.stiffness
    owner = table.owners(times)
    sticks, one = table.closed[owner, i], np.diff(owner) == 0
    beyond = np.where(sticks, np.abs(tension) - friction.most, np.abs(np.abs(tension) - friction.limit))
    moved = np.diff(slip)
    against = one & (moved * tension[1:] < 0) & (np.abs(moved) > MOVED * np.max(np.abs(place), initial=0.0))
    force = max(float(np.max(beyond)), float(np.max(np.abs(tension[1:][against]), initial=0.0)))
    spring = 0.0 if friction.rigid else friction.stiffness
    force -= ROUND_OFF * spring * float(np.max(np.abs(place), initial=0.0))
    way = float(np.max(np.abs(patch - patch[0] - slip)))
    return FrictionFound(way, max(0.0, force) / friction.limit, untold_switches(trajectory, table, name))
