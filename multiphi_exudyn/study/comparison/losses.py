"""How the losses of contact inside the first contact phase depend on modes and initial displacement.

The paper saw its beam leave the support twice inside the first contact. Such counts hang on small rebounds,
so they are given as a table over both parameters, and for rigid and compliant levels, not as one number.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.study.measures import metrics
from multiphi_exudyn.study.running.runs import interval_array
from multiphi_exudyn.study.scene_elements import DisplacedStart
from multiphi_exudyn.study.setup import Setup, start_configuration
from multiphi_exudyn.time.model_warnings import kept_back
from multiphi_exudyn.time.simulate import simulate

__all__ = ["loss_tables"]

MODES = (4, 6, 8, 12, 24)
FACTORS = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0)  # of the scene's own start


def loss_tables(setup: Setup) -> dict[str, pd.DataFrame]:
    """Kind of levels -> losses of contact inside the first phase by modes and start, "failed" where a run did.

    Of a scene with one contact; none where there is nothing to count, nor under loads, with force laws or friction:
    the tables are of a start that is scaled.
    """
    mechanics = setup.mechanics
    if setup.scene.file.loads or mechanics.force_laws or mechanics.frictions or len(mechanics.contacts) != 1:
        return {}
    (contact,) = mechanics.contacts
    modes = [r for r in MODES if r <= setup.structure.n - 1]
    start = start_configuration(setup, MultiPhiModel(setup.structure, [contact], modes=1))
    starts_closed = contact.gap + setup.structure.row(contact.direction) @ start <= 0
    if starts_closed or not modes or not np.isfinite(setup.longest_period):
        return {}
    kinds = {"rigid": True} if contact.rigid else {"compliant": False, "rigid": True}
    return {f"{kind} levels, {contact.name}": _table(setup, modes, rigid) for kind, rigid in kinds.items()}


def _table(setup: Setup, modes: list[int], rigid: bool) -> pd.DataFrame:
    model = MultiPhiModel(setup.structure, setup.contacts(rigid), modes=modes[0])
    start = start_configuration(setup, model)
    models = {f"r = {r}": replace(model, modes=r) for r in modes}
    counted = {
        _start_text(setup, factor): {name: _losses(setup, each, factor * start) for name, each in models.items()}
        for factor in FACTORS
    }
    return pd.DataFrame(counted, dtype=object)


def _start_text(setup: Setup, factor: float) -> str:
    start = setup.scene.file.start
    if isinstance(start, DisplacedStart):
        return f"{1e3 * factor * start.displacement:+g} mm"
    assert start is not None, "a scene without loads has a start"
    return f"{factor * start.force:+g} N"


def _losses(setup: Setup, model: MultiPhiModel, start: np.ndarray) -> int | str:
    """From a start that is scaled as a whole, which is exact for one off the contacts."""
    with kept_back():
        run = simulate(model, min(setup.t_end, setup.longest_period), displacement=start)
    intervals = interval_array(run.contact_intervals(model.contacts[0].name))
    return metrics.inner_losses(intervals, setup.longest_period) if run.status == "ok" else "failed"
