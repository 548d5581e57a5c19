"""Display of objects in a console and a notebook: one short line, or a small table."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

__all__ = ["Shown", "kinds", "names", "per_cent"]

MOST_NAMES = 6  # names that are listed
STYLE = ' style="text-align:left"'


class Shown:
    """An object with a short description: pairs (name, value) from its method ``_facts``."""

    def _facts(self) -> Iterable[tuple[str, str]]:
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {'; '.join(f'{name} {value}' for name, value in self._facts())}>"

    def _repr_html_(self) -> str:
        """The pairs as an HTML table, for notebooks."""
        rows = "".join(
            f"<tr><th{STYLE}>{html.escape(name)}</th><td{STYLE}>{html.escape(value)}</td></tr>"
            for name, value in self._facts()
        )
        return f"<table><caption{STYLE}>{type(self).__name__}</caption>{rows}</table>"


def names(values: Sequence[str]) -> str:
    """Names as text; of many the first ones and their number."""
    if not values:
        return "none"
    listed = ", ".join(values[:MOST_NAMES])
    return listed if len(values) <= MOST_NAMES else f"{listed}, ... ({len(values)})"


def kinds(warnings: Sequence[str]) -> str:
    """Kinds of warnings, that is their text before the colon."""
    return "; ".join(dict.fromkeys(warning.partition(":")[0] for warning in warnings)) or "none"


def per_cent(share: float) -> str:
    """A share in per cent, with two digits below 100 %."""
    return f"{100 * share:.2g} %" if share < 0.995 else f"{100 * share:.0f} %"
