"""Numbers in words: shares, times and ratios as a reader takes them in."""

from __future__ import annotations

import math
from collections.abc import Sequence

__all__ = ["engineering", "faster", "listed", "percent", "seconds", "sentence", "share", "times"]


def percent(value: float | None) -> str:
    """A share: "12.6 %", "2.32 %", below 0.1 % one figure."""
    if value is None or not math.isfinite(value):
        return "–"
    share = 100 * value
    if abs(share) < 0.1:
        return f"{share:.1g} %"
    return f"{share:.1f} %" if abs(share) >= 10 else f"{share:.2f} %"


def share(value: float) -> str:
    """A tolerance as it was given: "5 %", "0.5 %"."""
    return f"{100 * value:g} %"


def seconds(value: float | None) -> str:
    """A time with the unit that reads best."""
    if value is None or not math.isfinite(value):
        return "–"
    for scale, unit in ((1.0, "s"), (1e-3, "ms")):
        if abs(value) >= scale:
            return f"{value / scale:.3g} {unit}"
    return f"{value * 1e6:.3g} µs"


def times(value: float | None) -> str:
    """A ratio: "812 times"."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{value:.0f} times" if value >= 10 else f"{value:.2g} times"


def faster(ratio: float) -> str:
    """A ratio of times: "12 times faster", "1.5 times slower"."""
    return f"{times(ratio)} faster" if ratio >= 1 else f"{times(1 / ratio)} slower"


def engineering(value: float) -> str:
    """1e6 -> "1 M", with a prefix from kilo to giga."""
    for scale, prefix in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if value >= scale:
            return f"{value / scale:g} {prefix}"
    return f"{value:g} "


def listed(names: Sequence[str]) -> str:
    """Names as in a sentence: "a, b and c"."""
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else "".join(names)


def sentence(told: str) -> str:
    """The same with a capital and one full stop."""
    return f"{told[:1].upper()}{told[1:].removesuffix('.')}."
