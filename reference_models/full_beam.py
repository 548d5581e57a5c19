"""The full nonlinear model: Exudyn beams with contact elements, from the beams' description.

    M q'' + C_q q' + Q(q) = sum lambda_i d(g_i)/dq - sum F_j d(q_j)/dq - sum T_e d(q_e)/dq + f(t)
    lambda_i = k_i max(0, -g_i),   |T_e| <= limit

Large displacements, penalty contacts, local force laws F_j, friction T_e, loads and moving supports (actions.py),
implicit time integration. A reduced model of the same scene takes
its (M, C, K) from ``structure``, so that the two differ in nothing but the reduction, the geometric
nonlinearity and the time integration.
"""

from __future__ import annotations

import copy
import functools
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.exudyn_plugin import LinearizedStructure, linear_structure_from
from multiphi_exudyn.mechanics.beam import Beam
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.loads import Load
from reference_models.actions import Actions, actions_of
from reference_models.beam_system import BeamSystem, build_beam_system
from reference_models.beams import Beams, as_beams
from reference_models.drive import Drive
from reference_models.energy_history import (
    contact_losses,
    dissipated_energy,
    energy_history,
    friction_losses,
    work_of,
)
from reference_models.exudyn_quiet import quiet
from reference_models.full_beam_settings import FullBeamSettings
from reference_models.full_run import ENERGY_GAIN, EnergyBalance, FullRun, closed_intervals
from reference_models.histories import Histories, watched
from reference_models.integration import Integration, integrate
from reference_models.laid_beam import DEFLECTION, bending_coordinates
from reference_models.point_contact import point_contacts
from reference_models.point_friction import point_frictions
from reference_models.point_law import Law, point_laws
from reference_models.recorder import Recorder
from reference_models.solver_settings import simulation_settings
from reference_models.static_start import static_start

__all__ = ["FullBeam", "FullBeamSettings", "FullRun"]

DEFAULT_SETTINGS = FullBeamSettings()
SYMMETRY = 1e-9  # of the largest entry of a damping matrix
SUMMED = 1e-9  # of a time: how far the sum of many steps may fall short of it


class FullBeam:
    """A beam, or beams side by side, their contacts and friction as an Exudyn model.

    contacts: each on one point, or between two, with a finite stiffness; the force of a viscous one, and every force
    law, is a Python function that Exudyn calls several times a step (2 to 3 us a step more).
    frictions: each on one point, or between two, with a finite stiffness.
    settings: elements are those of each beam. structure: all of it without contacts and laws, linearised where it is
    straight; its points are beams.points.
    """

    def __init__(
        self,
        beam: Beam | Beams,
        contacts: Sequence[UnilateralContact],
        settings: FullBeamSettings = DEFAULT_SETTINGS,
        force_laws: Sequence[Law] = (),
        frictions: Sequence[Friction] = (),
    ) -> None:
        self.beams = as_beams(beam)
        self.contacts = point_contacts(self.beams, contacts)
        self.laws = point_laws(self.beams, force_laws)
        self.frictions = point_frictions(self.beams, frictions)
        self.settings = settings
        self._check_round({contact.name for contact in self.contacts if contact.damping}, "no damping")
        self._check_round({contact.name for contact in self.contacts if contact.other}, "one point")
        self._check_round({contact.name for contact in self.contacts if contact.tangent}, "no friction")
        started = time.process_time()
        with quiet():
            self.structure = _linearized(self.beams, settings)
        self._building_s = time.process_time() - started

    @property
    def dofs(self) -> int:
        """Number of free coordinates."""
        return self.structure.n

    def with_settings(self, settings: FullBeamSettings) -> FullBeam:
        """The same beam, discretised as it is, integrated otherwise."""
        if (settings.kind, settings.elements, settings.contact) != (
            self.settings.kind,
            self.settings.elements,
            self.settings.contact,
        ):
            raise MultiPhiValueError(f"settings: got {settings}, need the same kind, elements and contact")
        other = copy.copy(self)
        other.settings = settings
        return other

    @functools.cached_property
    def transverse(self) -> np.ndarray:
        """e (n,), the direction of gravity and base motion along +z: M e is the inertia of the whole beam moved by 1.

        M e counts the mass that couples free coordinates to those the clamp holds, which a row of ones on the
        free deflections leaves out; e is 1 at every point but for a few parts in 1e3 on the elements at the clamp.
        """
        with quiet():
            system = build_beam_system(self.beams, self.settings)
            mass = system.mbs.ComputeLinearizedSystem()[0]
        moved = np.zeros(len(mass))
        moved[system.first_coordinates + DEFLECTION] = 1.0
        return np.linalg.solve(self.structure.mass, self.structure.coordinates.T @ (mass @ moved))

    def run(
        self,
        t_end: float,
        *,
        load_at: str | None = None,
        measured_at: str | None = None,
        displacement: float | None = None,
        damping: np.ndarray | None = None,
        loads: Sequence[Load] = (),
        progress: bool = True,
    ) -> FullRun:
        """Pull at ``load_at`` until ``measured_at`` deflects by ``displacement`` [m], let go, integrate.

        Without these three the beam starts straight and at rest; friction carries what a slow pull leaves in it.
        damping: C [N s/m], (n, n), in the coordinates of ``structure``; it acts on deflections and rotations alone.
        loads: set in at t = 0, not before; their rows are in the coordinates of ``structure`` too. A numerical failure
        is a status of the result; MultiPhiValueError is for the arguments only.
        """
        if not (math.isfinite(t_end) and t_end > 0):
            raise MultiPhiValueError(f"t_end: got {t_end!r}, need a finite time > 0")
        start = self._start(load_at, measured_at, displacement)
        matrix = None if damping is None else self._full_damping(damping)
        actions = actions_of(self.structure, self.contacts, loads, t_end)
        self._check_round(set(actions.ways), "a stop that does not move")
        with quiet():
            started = time.process_time()
            load = None if start is None else start.load_at
            driven = bool(actions.courses)
            system = build_beam_system(
                self.beams, self.settings, self.contacts, matrix, load, self.laws, driven, self.frictions
            )
            solver = simulation_settings(self.settings, t_end)
            try:
                force = 0.0 if start is None else self._start_force(start, system, solver)
            except NumericalFailure as failure:
                return self._not_started(str(failure), self._building_s + time.process_time() - started)
            steps = solver.timeIntegration.numberOfSteps
            drive = Drive(system, actions, self.structure.coordinates, t_end, steps)
            offline_s = self._building_s + time.process_time() - started
            kept = watched(system, self.contacts, drive.forces)
            recorder = Recorder(system.mbs, kept, self.settings.output_step, t_end, progress)
            acting = None if actions.none else drive
            integration = integrate(system.mbs, solver, recorder, self.settings.cpu_limit_s, acting)
            return self._result(system, recorder, integration, matrix, actions, force, offline_s, t_end)

    def _check_round(self, names: set[str], needed: str) -> None:
        if self.settings.contact == "circle" and names:
            raise MultiPhiValueError(f"contact {min(names)!r}: got a circle, need {needed} or contact 'coordinate'")

    def _start_force(self, start: _Start, system: BeamSystem, solver: Any) -> float:
        measured = system.coordinate(start.measured_at)
        guess = start.displacement / self._flexibility(start.load_at, start.measured_at)
        return static_start(system, measured, start.displacement, guess, solver)

    def _start(self, load_at: str | None, measured_at: str | None, displacement: float | None) -> _Start | None:
        if load_at is None and measured_at is None and displacement is None:
            return None
        if displacement is None or not math.isfinite(displacement) or displacement == 0:
            raise MultiPhiValueError(f"displacement: got {displacement!r}, need a finite value, not zero")
        for name, point in (("load_at", load_at), ("measured_at", measured_at)):
            if not np.any(self.structure.row(self.beams.check_point(name, point))):
                raise MultiPhiValueError(f"{name}: got {point!r}, held by the clamp; need a point that moves")
        return _Start(str(load_at), str(measured_at), displacement)

    def _full_damping(self, damping: np.ndarray) -> np.ndarray:
        """C in Exudyn's coordinates, (n_full, n_full): S C S^T, as S has orthonormal columns, without axial entries.

        A beam that bends shortens by the integral of w'^2 / 2, which strains nothing. Axial entries of a constant C, of
        a stiffness thousands of times that of bending, would dissipate in it; damping by rates of strain does not.
        """
        matrix, n = np.asarray(damping, dtype=float), self.structure.n
        if matrix.shape != (n, n) or not np.all(np.isfinite(matrix)):
            raise MultiPhiValueError(f"damping: got shape {matrix.shape}, need {(n, n)} of finite numbers")
        if np.max(np.abs(matrix - matrix.T)) > SYMMETRY * np.max(np.abs(matrix)):
            raise MultiPhiValueError("damping: got an asymmetric matrix, need a symmetric one")
        full = self.structure.coordinates @ matrix @ self.structure.coordinates.T
        bends = bending_coordinates(self.settings.kind, len(full))
        return full * np.outer(bends, bends)

    def _flexibility(self, load_at: str, measured_at: str) -> float:
        """Linear contact-free deflection of one point under a unit force at another [m/N]."""
        load, measured = self.structure.row(load_at), self.structure.row(measured_at)
        return float(measured @ np.linalg.lstsq(self.structure.stiffness, load)[0])

    def _result(
        self,
        system: BeamSystem,
        recorder: Recorder,
        integration: Integration,
        damping: np.ndarray | None,
        actions: Actions,
        force: float,
        offline_s: float,
        t_end: float,
    ) -> FullRun:
        names = tuple(self.beams.points)
        steps = Histories.recorded(recorder, names, self.contacts, self.settings, actions.ways, self.frictions)
        ended = not integration.cause and len(steps.time) == len(recorder.times)
        last = t_end if ended else float(steps.time[-1])  # Exudyn's running time may fall short of the end it reaches
        grid = steps.at(_grid(last, self.settings.output_step))
        energy_time, energy = energy_history(system.mbs, recorder, self.laws, steps)
        lost = dissipated_energy(recorder, damping, energy_time) + contact_losses(steps, energy_time)
        tangents = [contact.tangent for contact in self.contacts if contact.tangent]
        speeds = [each.velocity for each in self.frictions] + [each.velocity for each in tangents]
        moved = not actions.none or any(speeds)
        work = work_of(actions, recorder, self.frictions, steps, energy_time) if moved else None
        rubbed = friction_losses(steps, energy_time)
        balance = EnergyBalance.of(energy_time, energy, lost, work, rubbed)
        failure = _failure(integration, recorder, steps, balance)
        return FullRun(
            status="failed" if failure else "ok",
            message=failure[0] if failure else "",
            failed_at=failure[1] if failure else None,
            time=grid.time,
            points=grid.points,
            contact_force=grid.forces,
            gaps=grid.gaps,
            contact_intervals={name: closed_intervals(steps.time, gap) for name, gap in steps.gaps.items()},
            friction_force=grid.tensions,
            slip=grid.slips,
            energy_time=energy_time,
            energy=energy,
            balance=balance,
            start_force=force,
            steps=len(steps.time) - 1,
            offline_s=offline_s,
            online_s=integration.cpu_s,
            dofs=self.dofs,
            settings=self.settings,
        )

    def _not_started(self, message: str, offline_s: float) -> FullRun:
        none = np.empty(0)
        contacts = {contact.name: none for contact in self.contacts}
        rubbing = [contact.name for contact in self.contacts if contact.tangent is not None]
        frictions = dict.fromkeys([*(friction.name for friction in self.frictions), *rubbing], none)
        return FullRun(
            status="failed",
            message=message,
            failed_at=0.0,
            time=none,
            points=dict.fromkeys(self.beams.points, none),
            contact_force=contacts,
            gaps=contacts,
            contact_intervals=dict.fromkeys(contacts, ()),
            friction_force=frictions,
            slip=frictions,
            energy_time=none,
            energy=none,
            balance=None,
            start_force=math.nan,
            steps=0,
            offline_s=offline_s,
            online_s=0.0,
            dofs=self.dofs,
            settings=self.settings,
        )


@dataclass(frozen=True)
class _Start:
    load_at: str
    measured_at: str
    displacement: float


def _linearized(beams: Beams, settings: FullBeamSettings) -> LinearizedStructure:
    system = build_beam_system(beams, settings)
    points = {name: (system.nodes[number], DEFLECTION) for name, number in system.points.items()}
    return linear_structure_from(system.mbs, points)[0]


def _grid(last: float, output_step: float) -> np.ndarray:
    """Multiples of output_step [s] up to the last time [s]."""
    return output_step * np.arange(math.floor((1 + SUMMED) * last / output_step) + 1)


def _failure(
    integration: Integration, recorder: Recorder, steps: Histories, balance: EnergyBalance
) -> tuple[str, float] | None:
    """Cause and time [s] of a failure; the first in time where there are several."""
    last = float(steps.time[-1])
    if balance.gain_at is not None:
        gain = f"energy gained: more than {ENERGY_GAIN:.0%} by {balance.gain_at:.6g} s"
        return f"{gain}, at worst {balance.worst_gain:.2%} at {balance.worst_gain_at:.6g} s", balance.gain_at
    if integration.cause:
        return f"{integration.cause} at {last:.6g} s", last
    if len(steps.time) < len(recorder.times):
        return f"state not finite after {last:.6g} s", last
    return None
