"""Binding of Create functions to Exudyn's MainSystem, so that they read as Exudyn's own: ``mbs.CreateX(...)``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import exudyn as exu

__all__ = ["bind"]


def bind(function: Callable[..., Any]) -> None:
    """Make ``function(mbs, ...)`` a method of ``mbs``, unless Exudyn has a method of this name itself.

    Exudyn's registry is used if it exists, else a plain class attribute.
    """
    name = function.__name__
    if hasattr(exu.MainSystem, name):
        return
    try:
        from exudyn.misc.extensionRegistry import extends, install
    except ImportError:
        setattr(exu.MainSystem, name, function)
        return
    extends(exu.MainSystem, name)(function)
    install()
