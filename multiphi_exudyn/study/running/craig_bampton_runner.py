"""Run a Craig-Bampton component with contact elements inside Exudyn.

The start is that of the linear model, projected on the component: exact where the load acts on an interface point.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.study.running.runner import Runner
from multiphi_exudyn.study.running.runs import interval_array
from multiphi_exudyn.study.setup import start_configuration
from reference_models.craig_bampton import CraigBampton, craig_bampton
from reference_models.craig_bampton_run import (
    CraigBamptonRun,
    CraigBamptonSettings,
    interface_contacts,
    solve_craig_bampton,
)
from reference_models.full_run import closed_intervals
from reference_models.point_contact import PointContact

__all__ = ["CraigBamptonRunner"]

GAP_SAMPLES = 10  # samples of a gap per recorded sample, for the interpolation of its zeros


@dataclass(frozen=True)
class Component:
    """Component, contacts, start q (b + m,), and the strain energy [J] lost by projecting the start (dropped)."""

    component: CraigBampton
    contacts: tuple[PointContact, ...]
    start: np.ndarray
    dropped: float

    def energy(self, recorded: CraigBamptonRun) -> np.ndarray:
        """Kinetic + strain energy (s,) [J], the contact springs included."""
        q, v = recorded.coordinates, recorded.velocities
        mass, stiffness = self.component.mass, self.component.stiffness
        energy = 0.5 * np.einsum("ti,ti->t", v @ mass, v) + 0.5 * np.einsum("ti,ti->t", q @ stiffness, q)
        for contact in self.contacts:
            energy += contact.energy(self.gap(contact, q))
        return energy

    def gap(self, contact: PointContact, q: np.ndarray) -> np.ndarray:
        """Gap (s,) [m] of a contact for coordinates q (s, b + m)."""
        return contact.gap + contact.coefficient * q[:, self.component.interface.index(contact.point)]


class CraigBamptonRunner(Runner):
    """Run the component; as for a full beam, a gain of energy is a failure."""

    may_gain_energy = True

    @property
    def label(self) -> str:
        load, interface = self.setup.scene.file.start, self.setup.interface
        start = "" if load is None or load.load_at in interface else ", start projected"
        reduced = f"{len(interface)} interface points + {self.spec.modes} modes"
        return f"Craig-Bampton in Exudyn, {reduced}, step {self.spec.step * 1e6:g} µs{start}"

    def prepare(self) -> Component:
        structure, contacts = self.setup.structure, self.setup.contacts(rigid=False)
        component = craig_bampton(structure, self.setup.interface, self.spec.modes)
        x = start_configuration(self.setup, MultiPhiModel(structure, contacts))
        start = component.coordinates(x)
        remainder = x - component.shapes @ start
        return Component(
            component, interface_contacts(contacts), start, 0.5 * float(remainder @ (structure.stiffness @ remainder))
        )

    def solve(self, prepared: Component) -> tuple[CraigBamptonRun, float]:
        spec, interval = self.spec, self.setup.scene.file.outputs.interval
        settings = CraigBamptonSettings(spec.step, spec.newton_tolerance, spec.spectral_radius, output_step=interval)
        t_end = self.setup.t_end
        answer = solve_craig_bampton(prepared.component, prepared.contacts, prepared.start, t_end, settings)
        return answer, answer.cpu_s

    def outcome(self, prepared: Component, answer: CraigBamptonRun) -> dict[str, Any]:
        status = "failed" if answer.cause else "ok"
        return {"dofs": prepared.component.dofs, "status": status, "message": answer.cause, "steps": answer.steps}

    def histories(self, prepared: Component, answer: CraigBamptonRun) -> dict[str, Any]:
        structure, shapes = self.setup.structure, prepared.component.shapes
        motion = CubicHermiteSpline(answer.time, answer.coordinates, answer.velocities)
        on_grid = motion(self.setup.time)
        fine = np.linspace(0.0, self.setup.t_end, GAP_SAMPLES * (len(answer.time) - 1) + 1)
        fields: dict[str, Any] = {
            "points": {name: on_grid @ (structure.row(name) @ shapes) for name in self.setup.points},
            "energy_time": answer.time,
            "energy": prepared.energy(answer),
            "ledger": {"truncation_strain": prepared.dropped},
        }
        for contact in prepared.contacts:
            gap, fine_gap = prepared.gap(contact, on_grid), prepared.gap(contact, motion(fine))
            of_contact = {
                "gaps": gap,
                "contact_force": contact.force(gap),
                "contact_intervals": interval_array(closed_intervals(fine, fine_gap)),
                "impulse": float(np.trapezoid(contact.force(fine_gap), fine)),
            }
            for name, value in of_contact.items():
                fields.setdefault(name, {})[contact.name] = value
        return fields
