"""How a full Exudyn beam is discretised and integrated."""

from __future__ import annotations

import math
from dataclasses import dataclass

from multiphi_exudyn.errors import MultiPhiValueError

__all__ = ["FullBeamSettings"]

_CHOICES = {"kind": ("ancf", "geometrically-exact"), "contact": ("coordinate", "circle")}
_POSITIVE = ("step", "newton_tolerance", "output_step", "circle_radius")


@dataclass(frozen=True)
class FullBeamSettings:
    """Discretisation, integrator and outputs of a full beam.

    kind: "ancf" (ANCFCable2D: no shear, no rotary inertia of the section) or "geometrically-exact"
        (ObjectBeamGeometricallyExact2D: shear stiffness k G A, rotary inertia).
    elements: aimed at; nodes stand at every point, mass and section end (mechanics.beam.beam_nodes).
    step: time step [s]; halved by the solver, down to step / 256, where its iteration does not converge.
    contact: "coordinate" (ObjectContactCoordinate on the node's deflection) or "circle"
        (ObjectContactCircleCable2D, a round support of ``circle_radius`` [m]; ancf only).
    newton_tolerance: relative and absolute. Exudyn's defaults of 1e-8 and 1e-10 lie below the round-off of
        an axially stiff beam and let the step collapse.
    full_newton: the Jacobian is computed in every iteration, not when one converges slowly; four times as dear.
    spectral_radius: of generalised alpha; 1 is the trapezoidal rule, below 1 damps what the step misses.
    output_step: grid [s] of the histories in the result.
    cpu_limit_s: CPU time [s] after which a run stops with a status.
    """

    kind: str = "ancf"
    elements: int = 20
    step: float = 2e-5
    contact: str = "coordinate"
    newton_tolerance: float = 1e-5
    full_newton: bool = False
    spectral_radius: float = 1.0
    output_step: float = 1e-4
    cpu_limit_s: float | None = None
    circle_radius: float = 5e-3

    def __post_init__(self) -> None:
        for name, choices in _CHOICES.items():
            if getattr(self, name) not in choices:
                raise MultiPhiValueError(f"{name}: got {getattr(self, name)!r}, need one of {choices}")
        for name in _POSITIVE:
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise MultiPhiValueError(f"{name}: got {value!r}, need a finite value > 0")
        if not 0 <= self.spectral_radius <= 1:
            raise MultiPhiValueError(f"spectral_radius: got {self.spectral_radius!r}, need 0 <= radius <= 1")
        if self.contact == "circle" and self.kind != "ancf":
            raise MultiPhiValueError(f"contact: got 'circle' with kind {self.kind!r}, need kind 'ancf'")
        if self.cpu_limit_s is not None and not self.cpu_limit_s > 0:
            raise MultiPhiValueError(f"cpu_limit_s: got {self.cpu_limit_s!r}, need a value > 0 or None")
