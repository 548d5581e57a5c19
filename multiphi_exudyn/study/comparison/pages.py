"""Pages and their sentences from the templates beside a package, with numbers as a reader takes them in."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import pandas as pd
from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from multiphi_exudyn.study.comparison.figure_style import data_uri
from multiphi_exudyn.study.comparison.wording import (
    engineering,
    faster,
    listed,
    percent,
    seconds,
    sentence,
    share,
    times,
)

__all__ = ["Picture", "embedded", "environment_of", "sentences"]

SHARED = "multiphi_exudyn.study.comparison"  # its templates are those of every page


@dataclass(frozen=True)
class Picture:
    """A figure as a data URI, with its caption."""

    source: str
    caption: str

    @classmethod
    def of(cls, figure: Figure, caption: str) -> Picture:
        """A figure, drawn."""
        return cls(data_uri(figure), caption)


def embedded(data: Any) -> Markup:
    """As JSON inside a script element, which no text in it can end."""
    return Markup(json.dumps(data).replace("<", "\\u003c"))


def html(frame: pd.DataFrame) -> Markup:
    """A table as a page has it, what it is of in its upper left corner (the name of its columns)."""
    return Markup(frame.to_html(border=0, index_names=frame.columns.name is not None))


FILTERS = (embedded, engineering, faster, html, listed, percent, seconds, sentence, share, times)


def environment_of(package: str) -> Environment:
    """The templates of a package; those of HTML escape what is filled in."""
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(name) for name in dict.fromkeys((package, SHARED))]),
        autoescape=lambda name: ".html" in (name or ""),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {function.__name__: function for function in FILTERS}
    return environment


def sentences(package: str, template: str, parts: Iterable[str], **values: Any) -> dict[str, tuple[str, ...]]:
    """Of each macro among ``parts`` the paragraphs that these values leave: a sentence or two each, on one line."""
    module = environment_of(package).get_template(template).make_module(values)
    texts = {name: str(getattr(module, name)()) for name in parts}
    return {
        name: tuple(" ".join(paragraph.split()) for paragraph in text.split("\n\n") if paragraph.strip())
        for name, text in texts.items()
    }
