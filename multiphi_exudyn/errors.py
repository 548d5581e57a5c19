"""Errors raised on purpose: what was given, and what was needed; the warning that an answer may be wrong.

Every error is a :class:`MultiPhiError` and, beside that, the built-in error an engineer would expect,
so ``except ValueError`` keeps working in code that has never heard of this package.
"""

from __future__ import annotations

__all__ = ["MultiPhiError", "MultiPhiTypeError", "MultiPhiValueError", "MultiPhiWarning", "NumericalFailure"]


class MultiPhiError(Exception):
    """Root of every error this package raises on purpose."""


class MultiPhiValueError(MultiPhiError, ValueError):
    """An argument has the right kind and the wrong value."""


class MultiPhiTypeError(MultiPhiError, TypeError):
    """An argument has the wrong kind."""


class NumericalFailure(MultiPhiError, RuntimeError):
    """A computation could not be carried through; the message names the cause."""


class MultiPhiWarning(UserWarning):
    """An answer was found, and there is a reason to distrust it; the sentence is in ``Trajectory.warnings`` too."""
