"""What a console and a notebook show of an object: one short line, and a small table."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

__all__ = ["Shown", "kinds", "names", "per_cent"]

MOST_NAMES = 6  # that are written out
STYLE = ' style="text-align:left"'


class Shown:
    """An object that says in a few facts what it is, (name, value) each; the class gives them as ``_facts``."""

    def _facts(self) -> Iterable[tuple[str, str]]:
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {'; '.join(f'{name} {value}' for name, value in self._facts())}>"

    def _repr_html_(self) -> str:
        """The facts as a table, which notebooks show."""
        rows = "".join(
            f"<tr><th{STYLE}>{html.escape(name)}</th><td{STYLE}>{html.escape(value)}</td></tr>"
            for name, value in self._facts()
        )
        return f"<table><caption{STYLE}>{type(self).__name__}</caption>{rows}</table>"


def names(given: Sequence[str]) -> str:
    """Names one after the other, of many the first ones and how many there are."""
    if not given:
        return "none"
    told = ", ".join(given[:MOST_NAMES])
    return told if len(given) <= MOST_NAMES else f"{told}, ... ({len(given)})"


def kinds(warnings: Sequence[str]) -> str:
    """The kinds of warnings, which are what stands before a colon."""
    return "; ".join(dict.fromkeys(warning.partition(":")[0] for warning in warnings)) or "none"


def per_cent(share: float) -> str:
    """A share in per cent, two digits of it below a hundred."""
    return f"{100 * share:.2g} %" if share < 0.995 else f"{100 * share:.0f} %"
