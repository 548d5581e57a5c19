"""Errors raised on purpose: what was given, and what was needed; the warning that an answer may be wrong.

Every error is a :class:`MultiPhiError` and, beside that, the built-in error an engineer would expect,
so ``except ValueError`` keeps working in code that has never heard of this package.
"""

from __future__ import annotations

__all__ = ["MultiPhiError", "MultiPhiTypeError", "MultiPhiValueError", "MultiPhiWarning", "NumericalFailure"]


class MultiPhiError(Exception):
    """Root of every error this package raises on purpose: what was given, and what was needed.

    Each is also the built-in error that an engineer would expect (ValueError, TypeError, RuntimeError), so code that
    catches those keeps working.

    Examples
    --------
    >>> import multiphi_exudyn as mp
    >>> try:
    ...     mp.UpTo(frequency=-1.0)
    ... except mp.MultiPhiError as error:
    ...     print(error)
    UpTo: got frequency -1.0 and most 60, need frequency > 0 and most >= 1
    """


class MultiPhiValueError(MultiPhiError, ValueError):
    """An argument has the right kind and the wrong value; also a ValueError.

    Examples
    --------
    >>> import multiphi_exudyn as mp
    >>> try:
    ...     mp.PointMass(at=0.5, mass=-1.0)
    ... except ValueError as error:
    ...     print(error)
    point mass: got mass -1.0, inertia 0.0, need values >= 0
    """


class MultiPhiTypeError(MultiPhiError, TypeError):
    """An argument has the wrong kind; also a TypeError.

    Examples
    --------
    >>> import multiphi_exudyn as mp
    >>> try:
    ...     mp.PointMass(at="tip", mass=1.0)
    ... except TypeError as error:
    ...     print(error)
    point mass at: got 'tip', need a number
    """


class NumericalFailure(MultiPhiError, RuntimeError):
    """A computation could not be carried through, and the message names the cause; also a RuntimeError.

    A run does not raise it: it ends early with the status "failed" and the cause in its ``message``.

    Examples
    --------
    >>> import multiphi_exudyn as mp
    >>> issubclass(mp.NumericalFailure, RuntimeError)
    True
    """


class MultiPhiWarning(UserWarning):
    """An answer was found, and there is a reason to distrust it; the sentence is in its ``warnings`` too.

    Examples
    --------
    Make an error of every warning, for runs that nobody watches:

    >>> import warnings
    >>> import multiphi_exudyn as mp
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", mp.MultiPhiWarning)
    """
