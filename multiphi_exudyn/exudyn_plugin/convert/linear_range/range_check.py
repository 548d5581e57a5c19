"""Range check: error of the linearisation in a reduced motion, at several times, with its warnings."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.display import per_cent

__all__ = ["LAG", "TOLERANCE", "RangeCheck"]

TOLERANCE = 0.01  # limit of the error: that of a pendulum with an amplitude of 1.1 degrees
LAG = 0.017  # rad: limit of the phase shift of oscillations at the end of a run, with an error of 1 % over the run


@dataclass(frozen=True)
class RangeCheck:
    """Error of the linearisation of an Exudyn system in a reduced motion.

    Returned by ``Reduction.check``, which evaluates the system's accelerations in the model's motion at a few times.

    Attributes
    ----------
    times : array (k,)
        Times of the evaluations [s].
    errors : array (k,)
        Displacement by what the model leaves out, relative to the motion's largest displacement.
    reason : str
        Why nothing could be checked; empty if it could.
    lag : float
        Estimated phase shift [rad] at the end of the run, by errors that repeat in every oscillation.
    softest : float
        Lowest stiffness per mass [1/s2] in the mean of the motion, in directions that the model leaves out because
        nothing moves the system there, if it is negative; else 0.

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
        """Largest error, nan if nothing could be checked."""
        return math.nan if self.reason else float(np.max(self.errors, initial=0.0))

    @property
    def holds(self) -> bool:
        """Whether the motion stayed within the linear range; False if nothing could be checked."""
        return self.error <= TOLERANCE and self.lag <= LAG

    @property
    def sentences(self) -> tuple[str, ...]:
        """Warnings, a sentence each; empty if the motion stayed within the linear range."""
        if self.reason:
            return (f"linear range: not checked, {self.reason}",)
        if self.holds:
            return ()
        if self.error <= TOLERANCE:
            return (
                f"linear range: what the model leaves out of its Exudyn system is small ({per_cent(self.error)}), but "
                f"shifts frequencies: at the end of the run the phase is off by some {self.lag:.1g} rad",
            )
        time = self.times[np.argmax(self.errors > TOLERANCE)]
        error = per_cent(self.error) if self.error < 1 else "more than 100 %"
        return (
            f"linear range: left by t = {time:.3g} s; what the model leaves out of its Exudyn system moves it by "
            f"{error} of the largest displacement; make the motion smaller, or solve the Exudyn system itself",
        )
