"""What models say of their own answers: their warnings by kind, and until when their runs are determined."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from multiphi_exudyn.study.comparison.wording import share
from multiphi_exudyn.study.setup import ROUND_OFF
from multiphi_exudyn.time.model_warnings import grouped

__all__ = ["run_warnings"]


def run_warnings(
    warnings: Sequence[tuple[str, Sequence[str]]], horizons: Sequence[tuple[str, Mapping[str, float]]], end: float
) -> list[str]:
    """A sentence for each kind of warning, and one where runs are not determined to their end [s].

    warnings: name of each run, and its own. horizons: name -> tolerance -> sensitivity horizon [s], of those asked.
    """
    told = [group.told(len(warnings)) for group in grouped(warnings)]
    known = [(until, tolerance, name) for name, each in horizons for tolerance, until in each.items()]
    early = [each for each in known if each[0] < ROUND_OFF * end]
    if not early:
        return told
    until, tolerance, name = min(early, key=lambda each: each[0])
    return [
        *told,
        f"sensitivity: {len(early)} of {len(known)} runs are not determined to their end: with a start changed by "
        f"1e-12 they differ by {share(float(tolerance))}, {name} from {until:.3g} s on; after that trust contact "
        "times and energies, not single values",
    ]
