"""Reliability: what to distrust in an answer, and what to do about it.

Every warning is one plain sentence with its number. It begins with its kind and a colon; many runs group them by kind:

    "linear range: ..."   what the model's own validity check says
"""

from __future__ import annotations

from multiphi_exudyn.trajectory import Trajectory

__all__ = ["warnings_of"]


def warnings_of(trajectory: Trajectory) -> tuple[str, ...]:
    """What a user must not miss of a run, one sentence each."""
    if not trajectory.segments:
        return ()
    found = list[str]()
    if trajectory.model.validity is not None:
        found.extend(trajectory.model.validity(trajectory))
    return tuple(found)
