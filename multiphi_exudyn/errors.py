"""Errors of the package, whose messages say what was given and what is needed, and its warning.

Every error is a :class:`MultiPhiError` and also the built-in error that an engineer would expect, so ``except
ValueError`` works without an import of this package.
"""

from __future__ import annotations

__all__ = ["MultiPhiError", "MultiPhiTypeError", "MultiPhiValueError", "MultiPhiWarning", "NumericalFailure"]


class MultiPhiError(Exception):
    """Base class of every error of this package; the message says what was given and what is needed.

    Each is also the built-in error that an engineer would expect (ValueError, TypeError, RuntimeError), so code that
    catches those works.

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
    """Error for an argument of the right type with a wrong value; also a ValueError.

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
    """Error for an argument of a wrong type; also a TypeError.

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
    """Failure of a computation, whose cause is in the message; also a RuntimeError.

    A run does not raise it, but ends early with the status "failed" and the cause in its ``message``.

    Examples
    --------
    >>> import multiphi_exudyn as mp
    >>> issubclass(mp.NumericalFailure, RuntimeError)
    True
    """


class MultiPhiWarning(UserWarning):
    """Warning that a result may be inaccurate; the result has the sentence in its ``warnings`` too.

    Examples
    --------
    Turn every warning into an error, for unattended runs:

    >>> import warnings
    >>> import multiphi_exudyn as mp
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", mp.MultiPhiWarning)
    """
