"""What a check of the linear range finds: how far a reduced motion left it, when, and how to say so."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.display import per_cent

__all__ = ["LAG", "TOLERANCE", "RangeCheck"]

TOLERANCE = 0.01  # error from which a motion has left the range: a pendulum that swings by 1.1 degrees has it
LAG = 0.017  # rad: shift of oscillations until the end of a run from which it is told; an error of 1 % of the run


@dataclass(frozen=True)
class RangeCheck:
    """How far a reduced motion left the range in which the linearisation of its Exudyn system holds.

    Made by ``Reduction.check``: at a few instants the system is asked for its accelerations in the model's motion.

    Attributes
    ----------
    times : array (k,)
        When it was asked [s].
    errors : array (k,)
        How far what the model leaves out moves it, relative to the motion's largest displacement.
    reason : str
        Why nothing could be checked; empty where it could.
    lag : float
        By how much [rad], about, errors that repeat in every oscillation shift it until the end of the run.
    softest : float
        The lowest stiffness per mass [1/s2] in the mean of the motion, if it is negative, of directions that the model
        is without because nothing moves the system there; else 0.

    Examples
    --------
    >>> import exudyn as exu
    >>> import exudyn.itemInterface as eii
    >>> import multiphi_exudyn as mp
    >>> from multiphi_exudyn.exudyn_plugin import linear_structure_from, reduce
    >>> container = exu.SystemContainer()
    >>> mbs = container.AddSystem()  # 1 kg on a spring of 4e4 N/m, a stop 1 mm below
    >>> ground = mbs.AddNode(eii.NodePointGround())
    >>> node = mbs.AddNode(eii.Node1D(initialVelocities=[-0.5]))
    >>> mass = mbs.AddObject(eii.ObjectMass1D(name="mass", mass=1.0, nodeNumber=node))
    >>> ends = [
    ...     mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=n, coordinate=0))
    ...     for n in (ground, node)
    ... ]
    >>> spring = mbs.AddObject(
    ...     eii.CoordinateSpringDamper(name="spring", markerNumbers=ends, stiffness=4e4)
    ... )
    >>> data = mbs.AddNode(
    ...     eii.NodeGenericData(initialCoordinates=[1.0], numberOfDataCoordinates=1)
    ... )
    >>> law = {"contactStiffness": 1e6, "offset": -1e-3, "nodeNumber": data}
    >>> stop = mbs.AddObject(
    ...     eii.ObjectContactCoordinate(name="stop", markerNumbers=ends, **law)
    ... )
    >>> mbs.Assemble()
    >>> reduction = reduce(mbs)
    >>> given = {"velocity": reduction.velocity, "loads": reduction.loads}
    >>> tr = mp.simulate(reduction.model, 0.1, **given)
    >>> reduction.check(tr).holds
    True
    """

    times: np.ndarray
    errors: np.ndarray
    reason: str = ""
    lag: float = 0.0
    softest: float = 0.0

    @property
    def error(self) -> float:
        """The largest error, nan where nothing could be checked."""
        return math.nan if self.reason else float(np.max(self.errors, initial=0.0))

    @property
    def holds(self) -> bool:
        """Whether the motion stayed within the linear range; False where nothing could be checked."""
        return self.error <= TOLERANCE and self.lag <= LAG

    @property
    def sentences(self) -> tuple[str, ...]:
        """What a user must not miss."""
        if self.reason:
            return (f"linear range: not checked, {self.reason}",)
        if self.holds:
            return ()
        if self.error <= TOLERANCE:
            return (
                f"linear range: what the model leaves out of its Exudyn system is small ({per_cent(self.error)}), but "
                f"shifts frequencies: at the end of the run the phase is off by some {self.lag:.1g} rad",
            )
        found = self.times[np.argmax(self.errors > TOLERANCE)]
        away = per_cent(self.error) if self.error < 1 else "more than 100 %"
        return (
            f"linear range: left by t = {found:.3g} s; what the model leaves out of its Exudyn system moves it by "
            f"{away} of the largest displacement; make the motion smaller, or solve the Exudyn system itself",
        )
