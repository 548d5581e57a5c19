"""How the losses of contact inside the first contact phase depend on modes and initial displacement.

The paper saw its beam leave the support twice inside the first contact. Such counts hang on small rebounds,
so they are given as a table over both parameters, and for rigid and compliant levels, not as one number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.study.measures import metrics
from multiphi_exudyn.study.scene.scene_file import DisplacedStart
from multiphi_exudyn.study.scene.workbench import Workbench, start_configuration
from multiphi_exudyn.time.simulate import simulate
from multiphi_exudyn.time.warning_groups import kept_back

__all__ = ["LossTable", "loss_tables"]

MODES = (4, 6, 8, 12, 24)
FACTORS = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0)  # of the scene's own start


@dataclass(frozen=True)
class LossTable:
    """counts: modes -> losses of contact inside the first phase, per start; None where a run failed.

    starts: how the starts are written, all of them the scene's own times a factor.
    """

    contact: str
    levels: str
    starts: tuple[str, ...]
    counts: Mapping[int, tuple[int | None, ...]]


def loss_tables(bench: Workbench) -> tuple[LossTable, ...]:
    """One table per kind of level, of a scene with one contact; none where there is nothing to count.

    Nor under loads, with force laws or friction: the tables are of a start that is scaled.
    """
    if (
        bench.scene.file.loads
        or bench.mechanics.force_laws
        or bench.mechanics.frictions
        or not (len(bench.mechanics.contacts) == 1 and np.isfinite(bench.longest_period))
        or _starts_closed(bench)
    ):
        return ()
    modes = [r for r in MODES if r <= bench.structure.n - len(bench.mechanics.contacts)]
    rigid = {bench.mechanics.contacts[0].rigid, True}
    return tuple(_table(bench, modes, kind) for kind in sorted(rigid) if modes)


def _starts_closed(bench: Workbench) -> bool:
    start = start_configuration(bench, MultiPhiModel(bench.structure, bench.mechanics.contacts, modes=1))
    gaps = [contact.gap + bench.structure.row(contact.direction) @ start for contact in bench.mechanics.contacts]
    return min(gaps) <= 0


def _table(bench: Workbench, modes: Sequence[int], rigid: bool) -> LossTable:
    contacts = bench.contacts(rigid)
    model = MultiPhiModel(bench.structure, contacts, modes=modes[0])
    start = start_configuration(bench, model)
    counts = {r: _counts(bench, replace(model, modes=r), start) for r in modes}
    return LossTable(contacts[0].name, "rigid" if rigid else "compliant", _starts(bench), counts)


def _starts(bench: Workbench) -> tuple[str, ...]:
    start = bench.scene.file.start
    if isinstance(start, DisplacedStart):
        return tuple(f"{1e3 * factor * start.displacement:+g} mm" for factor in FACTORS)
    assert start is not None, "a scene without loads has a start"
    return tuple(f"{factor * start.force:+g} N" for factor in FACTORS)


def _counts(bench: Workbench, model: MultiPhiModel, start: np.ndarray) -> tuple[int | None, ...]:
    """The start is scaled as a whole, which is exact for a start off the contacts."""
    end = min(bench.t_end, bench.longest_period)
    counts: list[int | None] = []
    for factor in FACTORS:
        with kept_back():
            trajectory = simulate(model, end, displacement=factor * start)
        intervals = np.array(trajectory.contact_intervals(model.contacts[0].name)).reshape(-1, 2)
        ok = trajectory.status == "ok"
        counts.append(metrics.inner_losses(intervals, bench.longest_period) if ok else None)
    return tuple(counts)
