"""What the reduced models of a comparison say of their own answers: warnings and sensitivity horizons, in words."""

from __future__ import annotations

import math
from collections.abc import Iterable

from multiphi_exudyn.study.comparison.compare import Comparison
from multiphi_exudyn.study.comparison.wording import listed, share
from multiphi_exudyn.study.scene.workbench import ROUND_OFF

__all__ = ["warned"]


def warned(comparison: Comparison) -> list[str]:
    """What the reduced models say of their own answers, a sentence each: its kind, of which models, and the rest."""
    found = [(*sentence.partition(": "), names) for sentence, names in comparison.warnings.items()]
    return [f"{kind}, {listed(names)}: {rest}" for kind, _, rest, names in found] + list(_nudged(comparison))


def _nudged(comparison: Comparison) -> Iterable[str]:
    """Until when runs are determined, where that is not to their end."""
    for tolerance in comparison.nudged:
        ends = {name: run.horizon_s.get(tolerance, math.inf) for name, run in comparison.runs.items()}
        early = [f"{name} {end:.3g} s" for name, end in ends.items() if end < ROUND_OFF * comparison.bench.t_end]
        if early:
            yield (
                f"sensitivity: with a start changed by 1e-12 a run stays within {share(float(tolerance))} of this "
                f"one until: {listed(early)}; after that trust contact times and energies, not single values"
            )
