"""Reliability: what to distrust in an answer, and what to do about it.

Every warning is one plain sentence with its number. It begins with its kind and a colon; many runs group them by kind:

    "linear range: ..."   what the model's own validity check says
    "cluster: ..."        levels that keep more modes than asked for, so that no modes of one frequency are parted
    "load pieces: ..."    loads of so many samples or pieces that the run takes long
"""

from __future__ import annotations

from multiphi_exudyn.driven.level import DrivenLevel
from multiphi_exudyn.trajectory import Trajectory

__all__ = ["warnings_of"]

MANY_PIECES = 2**16  # of loads in a run: half a minute of computing and 200 MB
PIECE_SECONDS = 5e-4  # that a piece of a load takes in a small model
PIECE_BYTES = 3000  # that it takes there


def warnings_of(trajectory: Trajectory) -> tuple[str, ...]:
    """What a user must not miss of a run, one sentence each."""
    if not trajectory.segments:
        return ()
    found = _clusters(trajectory)
    if trajectory.model.validity is not None:
        found.extend(trajectory.model.validity(trajectory))
    found.extend(_load_pieces(trajectory))
    return tuple(found)


def _clusters(trajectory: Trajectory) -> list[str]:
    """One sentence where levels of the run keep modes beyond those asked for."""
    if not trajectory.model.keeps_clusters:
        return []  # without a look at segments, which a run makes only when they are asked for
    visited = dict.fromkeys(segment.level.level.indices for segment in trajectory.segments)
    levels = [trajectory.model.level_at(indices) for indices in visited]
    kept = [level for level in levels if level.kept_beyond]
    if not kept:
        return []
    most = max(kept, key=lambda level: level.kept_beyond)
    asked, name = most.modes - most.kept_beyond, ", ".join(most.closed) or "open"
    return [
        f"cluster: {len(kept)} of {len(levels)} levels keep more modes than asked for, level ({name}) {most.modes} in "
        f"place of {asked}, as a cut between modes of one frequency ({most.frequencies[asked - 1]:.6g} Hz) would be "
        f"arbitrary; ask for {most.modes} modes"
    ]


def _load_pieces(trajectory: Trajectory) -> list[str]:
    """Whether the loads have so many pieces that they set the time and memory of the run."""
    level = trajectory.segments[0].level
    if not isinstance(level, DrivenLevel) or level.excitation.effort(trajectory.t_end) <= MANY_PIECES:
        return []
    pieces = level.excitation.pieces(trajectory.t_end)
    each = 1e3 * PIECE_SECONDS * level.excitation.effort(trajectory.t_end) / pieces
    return [
        f"load pieces: the loads have {pieces} pieces in {trajectory.t_end:g} s, some {each:.1g} ms and "
        f"{PIECE_BYTES / 1000:g} kB each; fewer samples, a larger tolerance or a lower highest frequency make the run "
        "shorter"
    ]
