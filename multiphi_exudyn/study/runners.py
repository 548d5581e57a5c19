"""Runners: one model of a scene run from start to end: its histories on the common grid, its energy, and what it cost.

Offline: discretisation, linearisation, modes, static start. Online: the solver alone, from the start to the end of the
run. Times are CPU times: waiting for other programs does not count. Every kind of model (model_kinds.py) has a runner;
a failure gives a run with a cause, not an exception.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from multiphi_exudyn.errors import MultiPhiError, NumericalFailure
from multiphi_exudyn.exudyn_plugin import BodyHistories
from multiphi_exudyn.levels.equilibrium.static_equilibrium import Equilibrium
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.beam import beam_nodes
from multiphi_exudyn.mechanics.structure import LinearStructure, damping_matrix
from multiphi_exudyn.study.runs import ModelRun, interval_array, modes_text, path_length, repeated, timed
from multiphi_exudyn.study.scene_elements import DisplacedStart
from multiphi_exudyn.study.setup import Setup, start_configuration, start_equilibrium
from multiphi_exudyn.time.model_warnings import kept_back
from multiphi_exudyn.time.simulate import simulate
from multiphi_exudyn.time.trajectory import Trajectory
from multiphi_exudyn.time.truncation import truncation_indicator
from reference_models.body_alone import solve_body_alone
from reference_models.craig_bampton import CraigBampton, craig_bampton
from reference_models.craig_bampton_run import (
    CraigBamptonRun,
    CraigBamptonSettings,
    interface_contacts,
    solve_craig_bampton,
)
from reference_models.full_beam import FullBeam, FullRun
from reference_models.full_run import ENERGY_GAIN, EnergyBalance, closed_intervals
from reference_models.gentler import Attempt, attempts
from reference_models.global_basis import global_basis
from reference_models.pod_basis import pod_basis
from reference_models.point_contact import PointContact
from reference_models.splitting import Splitting, SplittingRun, splitting
from reference_models.stepwise import StepwiseHistories, StepwiseRun, solve_stepwise

__all__ = ["ready_model", "run_model"]

ENERGY_INTERVAL = 1e-3  # s, between samples of the energy
HORIZON_TOLERANCE = 0.01  # of the motion: difference to a perturbed run that is visible in a plot
STICK_DISTANCE = 1e-6  # of the range of its slip: a patch that moves less between two samples sticks
GAP_SAMPLES = 10  # samples of a component's gap per recorded sample, for the interpolation of its zeros

Prepared = tuple[MultiPhiModel, Equilibrium]


def run_model(setup: Setup, name: str, progress: bool = True, retry: bool = False, horizon: bool = False) -> ModelRun:
    """Run the scene's model ``name``; a failed run has status "failed" and its cause.

    retry: run a failed full beam again with smaller steps and more damping; not for a study of these settings.
    horizon: run a reduced model once more from a perturbed start. Warnings are stored in the run, not issued.
    """
    spec = setup.scene.models[name]
    runner = RUNNERS[spec.kind](setup, spec, progress, retry, horizon)
    with kept_back():
        label = runner.label
        try:
            return runner.run()
        except (MultiPhiError, ArithmeticError, RuntimeError, ValueError) as error:
            return ModelRun(name, spec.kind, label, status="failed", message=" ".join(str(error).split()))


def ready_model(setup: Setup, name: str) -> Callable[[], float]:
    """Prepare the scene's model ``name`` and run it once; every call runs it again and returns the solver's time [s].

    Raises where the model fails.
    """
    spec = setup.scene.models[name]
    return RUNNERS[spec.kind](setup, spec).ready()


@dataclass(frozen=True)
class Runner(ABC):
    """Runner of one model of a scene. spec: its entry in the scene; other fields: see ``run_model``."""

    builds_levels: ClassVar[bool] = False  # in its first run, which takes longer than a repeat
    may_gain_energy: ClassVar[bool] = False  # whether time integration may gain energy, an error

    setup: Setup
    spec: Any
    progress: bool = False
    retry: bool = False
    horizon: bool = False

    @property
    @abstractmethod
    def label(self) -> str:
        """Name of the model in tables and figures."""

    def prepare(self) -> Any:
        """Do the offline part; by default build the Multi-Phi model and its start equilibrium."""
        model = self.setup.model(self.spec)
        return model, start_equilibrium(self.setup, model)

    @abstractmethod
    def solve(self, prepared: Any) -> tuple[Any, float]:
        """Solve, and return the answer and the time of the solver [s]."""

    @abstractmethod
    def outcome(self, prepared: Any, answer: Any) -> dict[str, Any]:
        """Fields of a ModelRun about status, size and steps."""

    @abstractmethod
    def histories(self, prepared: Any, answer: Any) -> dict[str, Any]:
        """Fields of a ModelRun on the common grid, for an answer that reached the end."""

    def repeats(self, answer: Any) -> int:
        """Number of timed repeats, more for a short run."""
        return self.setup.repeats

    def run(self) -> ModelRun:
        """Prepare, solve and sample."""
        prepared, preparation_s = timed(self.prepare)
        answer, first = self.solve(prepared)
        as_long = 0.0 if self.builds_levels else first
        repeats = repeated(lambda: self.solve(prepared)[1], as_long, self.repeats(answer))
        run = ModelRun(
            name=self.spec.name,
            kind=self.spec.kind,
            label=self.label,
            offline_s=self.setup.structure_s + preparation_s,
            first_s=first,
            repeats_s=repeats,
        )
        run = replace(run, **self.outcome(prepared, answer))
        if not run.ok:
            return run
        histories, sampling_s = timed(lambda: self.histories(prepared, answer))
        sampled: dict[str, Any] = {"time": self.setup.time, "sampling_s": sampling_s} | histories
        complete = replace(run, **sampled)
        cause = _energy_gain(complete) if self.may_gain_energy else ""
        return replace(run, status="failed", message=cause) if cause else complete

    def ready(self) -> Callable[[], float]:
        """Prepare and solve once; every call solves again, and returns the time of the solver [s].

        Raises NumericalFailure where the answer has failed.
        """
        prepared = self.prepare()
        outcome = self.outcome(prepared, self.solve(prepared)[0])
        if outcome["status"] != "ok":
            raise NumericalFailure(f"{self.label}: {outcome['message']}")
        return lambda: self.solve(prepared)[1]

    def level_text(self) -> str:
        """Kind of levels, as part of a label."""
        contacts = self.setup.contacts(self.spec.rigid)
        if not contacts:
            return "levels of force laws" if self.setup.mechanics.force_laws else "levels of friction"
        return f"{'rigid' if all(contact.rigid for contact in contacts) else 'compliant'} levels"

    def printed_text(self) -> str:
        """Note on printed frequencies, as part of a label; else empty."""
        return ", printed frequencies" if self.setup.overrides else ""


def _energy_gain(run: ModelRun) -> str:
    """Message if the energy has risen above an earlier value; empty if not."""
    balance = EnergyBalance.of(run.energy_time, run.energy, np.zeros_like(run.energy))
    if balance.gain_at is None:
        return ""
    gained = f"energy gained: more than {ENERGY_GAIN:.0%} by {balance.gain_at:.6g} s"
    return f"{gained}, at worst {balance.worst_gain:.2%} at {balance.worst_gain_at:.6g} s"


class ReducedRunner(Runner):
    """Run the Multi-Phi model of an entry of the scene."""

    builds_levels = True

    @property
    def label(self) -> str:
        spec = self.spec
        modes = f"modes for a truncation error of {spec.tolerance:g}" if spec.tolerance else modes_text(spec.modes)
        one = ", one basis with residual flexibility" if spec.boundary == "residual" else ""
        return f"Multi-Phi, {self.level_text()}{one}, {modes}{self.printed_text()}"

    def solve(self, prepared: Prepared) -> tuple[Trajectory, float]:
        model, start = prepared
        return timed(lambda: simulate(model, self.setup.t_end, start=start, loads=self.setup.loads))

    def outcome(self, prepared: Prepared, answer: Trajectory) -> dict[str, Any]:
        return {
            "dofs": answer.segments[0].level.level.modes if answer.segments else 0,
            "status": answer.status,
            "message": answer.message,
            "steps": len(answer.events),
            "warnings": answer.warnings,
        }

    def histories(self, prepared: Prepared, answer: Trajectory) -> dict[str, Any]:
        time, t_end = self.setup.time, self.setup.t_end
        contacts, frictions = [c.name for c in self.setup.mechanics.contacts], self.setup.mechanics.friction_names
        points, points_s = timed(lambda: {name: answer.at(name, time) for name in self.setup.points})
        gaps, gaps_s = timed(lambda: {name: answer.gap(name, time) for name in contacts})
        energy_time = np.linspace(0.0, t_end, round(t_end / ENERGY_INTERVAL) + 1)
        return {
            "points": points,
            "gaps": gaps,
            "contact_force": {name: answer.contact_force(name, time) for name in contacts},
            "contact_intervals": {name: interval_array(answer.contact_intervals(name)) for name in contacts},
            "impulse": {name: answer.contact_impulse(name, 0.0, t_end) for name in contacts},
            "friction_force": {name: answer.friction_force(name, time) for name in frictions},
            "slip": {name: answer.slip(name, time) for name in frictions},
            "stick_intervals": {name: answer.stick_intervals(name) for name in frictions},
            "energy_time": energy_time,
            "energy": answer.energy(energy_time),
            "ledger": asdict(answer.ledger) | {"residual": answer.ledger.residual},
            "sampling_s": points_s + gaps_s,
            "indicators": self.indicators(answer),
            "horizon_s": {f"{HORIZON_TOLERANCE:g}": answer.horizon(HORIZON_TOLERANCE)} if self.horizon else {},
        }

    def indicators(self, answer: Trajectory) -> dict[str, float]:
        """The model's estimates of its truncation error: end of the window [s] -> estimate."""
        return {f"{until:g}": truncation_indicator(answer, until) for until in self.setup.windows}


class GlobalBasisRunner(ReducedRunner):
    """Run the structure projected on one basis, from its static equilibrium, with all modes of the basis."""

    @property
    def label(self) -> str:
        return f"global basis, {self.level_text()}, r = {self.spec.modes} from each of two"

    def prepare(self) -> Prepared:
        projected = self.projected()
        model = MultiPhiModel(projected, self.setup.nonlinearities(self.spec.rigid), modes="all")
        return model, start_equilibrium(replace(self.setup, structure=projected), model)

    def projected(self) -> LinearStructure:
        """The structure projected on the basis."""
        return global_basis(self.setup.structure, self.setup.contacts(self.spec.rigid), self.spec.modes)

    def indicators(self, answer: Trajectory) -> dict[str, float]:
        """Empty: the estimate needs modes of levels."""
        return {}


class TrainedBasisRunner(GlobalBasisRunner):
    """Run the structure on a basis of snapshots; the training run belongs to the offline time."""

    @property
    def label(self) -> str:
        return f"POD basis of {self.spec.training:g} s, {self.level_text()}, r = {self.spec.modes}"

    def projected(self) -> LinearStructure:
        """The structure projected on the basis."""
        setup = self.setup
        complete = MultiPhiModel(setup.structure, setup.nonlinearities(self.spec.rigid), modes="all")
        until = min(self.spec.training, setup.t_end)
        return pod_basis(
            simulate(complete, until, start=start_equilibrium(setup, complete), loads=setup.loads), self.spec.modes
        )


class BodyRunner(Runner):
    """Run the body alone in a system, its modes matched to the step."""

    @property
    def label(self) -> str:
        levels = f"{self.level_text()}, r = {self.spec.modes}{self.printed_text()}"
        return f"Exudyn user object, {levels}, step {self.spec.step * 1e6:g} µs"

    @property
    def steps(self) -> int:
        """Number of time steps of the run."""
        return int(np.ceil(self.setup.t_end / self.spec.step * (1 - 1e-9)))

    def solve(self, prepared: Prepared) -> tuple[BodyHistories, float]:
        setup = self.setup
        return solve_body_alone(*prepared, setup.t_end, self.steps, setup.points, loads=setup.loads)

    def outcome(self, prepared: Prepared, answer: BodyHistories) -> dict[str, Any]:
        return {"dofs": prepared[0].level(()).modes, "steps": self.steps, "warnings": answer.warnings}

    def histories(self, prepared: Prepared, answer: BodyHistories) -> dict[str, Any]:
        contacts = [contact.name for contact in self.setup.mechanics.contacts]
        return {
            "points": {
                name: CubicHermiteSpline(answer.time, values, answer.velocities[name])(self.setup.time)
                for name, values in answer.points.items()
            },
            "gaps": self._interpolated(answer, {name: answer.gaps[name] for name in contacts}),
            "contact_force": self._interpolated(answer, {name: answer.contact_force[name] for name in contacts}),
            "contact_intervals": {name: interval_array(answer.contact_intervals[name]) for name in contacts},
            "impulse": {name: _impulse(answer, name) for name in contacts},
            "friction_force": self._interpolated(answer, answer.friction_force),
            "slip": self._interpolated(answer, answer.slip),
            "stick_intervals": dict(answer.stick_intervals),
            "ledger": self._ledger(answer),
        }

    def _interpolated(self, answer: BodyHistories, histories: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        return {name: np.interp(self.setup.time, answer.time, values) for name, values in histories.items()}

    def _ledger(self, answer: BodyHistories) -> dict[str, float]:
        """Energy lost at events, and dissipated by friction along the sampled slip [J]."""
        rows = ["impact", "truncation_kinetic", "truncation_strain", *(["friction"] if answer.slip else [])]
        losses = {row: float(sum(getattr(event.loss, row) for event in answer.events)) for row in rows}
        for friction in self.setup.mechanics.frictions:
            losses["friction"] += friction.limit * path_length(answer.slip[friction.name])
        for contact in self.setup.mechanics.contacts:
            if contact.friction:
                force, slip = answer.friction_force[contact.name], answer.slip[contact.name]
                losses["friction"] += float(np.trapezoid(force, slip))
        return losses


def _impulse(answer: BodyHistories, contact: str) -> float:
    """Impulse [N s] of the recorded force, by the trapezoidal rule, and of the impacts."""
    impacts = sum(event.impulse for event in answer.events if event.contact == contact)
    return float(np.trapezoid(answer.contact_force[contact], answer.time) + impacts)


class FullRunner(Runner):
    """A full beam with the scene's damping on its own mesh; histories come on the common grid.

    With ``retry`` a failed run is repeated with other settings (reference_models/gentler.py); the message then says
    with which, and the time is that of all attempts.
    """

    @property
    def label(self) -> str:
        kind = "ANCF" if self.spec.beam == "ancf" else "geometrically exact"
        beam, each = ("beams", " each") if self.setup.mechanics.beam is None else ("beam", "")
        return f"full Exudyn {beam}, {kind}, {self._elements()} elements{each}, step {self.spec.step * 1e6:g} µs"

    def _elements(self) -> str:
        """How many a beam has: more than asked for where points need nodes."""
        beams = self.setup.mechanics.beams
        assert beams is not None, "checked where the scene was loaded"
        counts = [len(beam_nodes(beam, self.spec.elements)) - 1 for beam in beams.parts.values()]
        return " to ".join(dict.fromkeys(f"{count}" for count in (min(counts), max(counts))))

    def prepare(self) -> tuple[FullBeam, dict[str, Any]]:
        beam = self.setup.full_beam(self.spec)
        damping = damping_matrix(replace(beam.structure, damping=self.setup.mechanics.damping))
        return beam, {"damping": damping, "loads": self.setup.loads_on(beam), **self._start()}

    def solve(self, prepared: tuple[FullBeam, dict[str, Any]]) -> tuple[list[Attempt], float]:
        beam, options = prepared

        def run(beam: FullBeam) -> FullRun:
            return beam.run(self.setup.t_end, progress=self.progress, **options)

        runs = attempts(beam, run) if self.retry else [Attempt("as asked", run(beam))]
        return runs, sum(attempt.run.online_s for attempt in runs)

    def repeats(self, answer: list[Attempt]) -> int:
        return self.setup.repeats if len(answer) == 1 else 0

    def outcome(self, prepared: Any, answer: list[Attempt]) -> dict[str, Any]:
        result = answer[-1].run
        return {
            "dofs": result.dofs,
            "status": result.status,
            "message": _message(answer),
            "steps": result.steps,
            "offline_s": result.offline_s,
        }

    def histories(self, prepared: Any, answer: list[Attempt]) -> dict[str, Any]:
        result = answer[-1].run
        forces, balance = result.contact_force, result.balance
        assert balance is not None, "a run that is ok has a balance"
        return {
            "points": {name: result.points[name] for name in self.setup.points},
            "gaps": result.gaps,
            "contact_force": forces,
            "contact_intervals": {name: interval_array(pairs) for name, pairs in result.contact_intervals.items()},
            "impulse": {name: float(np.trapezoid(force, result.time)) for name, force in forces.items()},
            "friction_force": result.friction_force,
            "slip": result.slip,
            "stick_intervals": {name: _stick_intervals(result.time, slip) for name, slip in result.slip.items()},
            "energy_time": result.energy_time,
            "energy": result.energy,
            "ledger": {
                "initial": balance.initial,
                "work_of_loads": balance.work,
                "damping": balance.dissipated,
                **({"friction": balance.friction} if result.slip else {}),
                "final": balance.final,
                "residual": balance.initial + balance.work - balance.dissipated - balance.friction - balance.final,
                "worst_gain": balance.worst_gain * balance.scale,
            },
            "sampling_s": 0.0,  # recorded on the grid
        }

    def _start(self) -> dict[str, Any]:
        """Options of the static start load: point and displacement; empty for a start at rest."""
        setup, start = self.setup, self.setup.scene.file.start
        if start is None:
            return {}
        if isinstance(start, DisplacedStart):
            return start.model_dump()
        model = MultiPhiModel(setup.structure, setup.nonlinearities(rigid=False))
        displacement = float(setup.structure.row(start.load_at) @ start_configuration(setup, model))
        return {"load_at": start.load_at, "measured_at": start.load_at, "displacement": displacement}


def _message(runs: Sequence[Attempt]) -> str:
    """Message of a single attempt; of several, what was tried and with which settings the run succeeded."""
    last = runs[-1]
    if len(runs) == 1:
        return last.run.message
    if last.run.status == "ok":
        return f"ran with gentler settings ({last.settings}); {'; '.join(attempt.told for attempt in runs[:-1])}"
    return f"failed with every setting; {'; '.join(attempt.told for attempt in runs)}"


def _stick_intervals(time: np.ndarray, slip: np.ndarray) -> np.ndarray:
    """Intervals (m, 2) [s] in which a patch with slip (k,) on a time grid sticks."""
    sticks = np.abs(np.diff(slip)) <= STICK_DISTANCE * np.ptp(slip)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], sticks, [False]]).astype(int)))
    return np.asarray(time[edges].reshape(-1, 2))


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


class _StepRunner(Runner):
    """Runner of a method whose answer has histories at arbitrary times."""

    may_gain_energy = True

    def sampler(self, answer: Any) -> Callable[[Sequence[str], np.ndarray], StepwiseHistories]:
        """Return the function that evaluates histories of points at times (k,) [s]."""
        return answer.histories

    def histories(self, prepared: Any, answer: StepwiseRun | SplittingRun) -> dict[str, Any]:
        time, t_end, sampler = self.setup.time, self.setup.t_end, self.sampler(answer)
        histories, sampling = timed(lambda: sampler(self.setup.points, time))
        energy_time = np.linspace(0.0, t_end, round(t_end / ENERGY_INTERVAL) + 1)
        forces = histories.contact_force
        return {
            "points": histories.points,
            "gaps": histories.gaps,
            "contact_force": forces,
            "contact_intervals": {name: interval_array(answer.contact_intervals(name)) for name in forces},
            "impulse": {name: float(np.trapezoid(force, time)) for name, force in forces.items()},
            "energy_time": energy_time,
            "energy": sampler((), energy_time).energy,
            "sampling_s": sampling,
        }


class StepwiseRunner(_StepRunner):
    """The reduced equations of a Multi-Phi model by solve_ivp."""

    @property
    def label(self) -> str:
        method = f"{self.spec.method}, rtol {self.spec.rtol:g}"
        return f"solve_ivp, {method}, compliant levels, {modes_text(self.spec.modes)}"

    def solve(self, prepared: tuple[MultiPhiModel, Equilibrium]) -> tuple[StepwiseRun, float]:
        model, start = prepared
        options = {"method": self.spec.method, "rtol": self.spec.rtol}
        return timed(lambda: solve_stepwise(model, self.setup.t_end, start.displacement, **options))

    def outcome(self, prepared: Any, answer: StepwiseRun) -> dict[str, Any]:
        return {
            "dofs": answer.segments[0].level.level.modes,
            "status": "failed" if answer.message else "ok",
            "message": answer.message,
            "steps": answer.steps,
        }


class SplittingRunner(_StepRunner):
    """A Craig-Bampton component by Strang splitting; a motion that overflows is a failed run."""

    builds_levels = True

    def sampler(self, answer: Any) -> Callable[[Sequence[str], np.ndarray], StepwiseHistories]:
        return partial(answer.histories, self.setup.structure)

    @property
    def label(self) -> str:
        modes = f"{self.spec.modes} + {len(self.setup.interface)} modes"
        return f"Strang splitting, {modes}, step {1e6 * self.spec.step:g} us"

    def prepare(self) -> tuple[Splitting, np.ndarray]:
        setup = self.setup
        contacts = setup.contacts(rigid=False)
        component = splitting(setup.structure, contacts, setup.interface, self.spec.modes)
        return component, start_configuration(setup, MultiPhiModel(setup.structure, contacts))

    def solve(self, prepared: tuple[Splitting, np.ndarray]) -> tuple[SplittingRun, float]:
        component, start = prepared
        with np.errstate(over="ignore", invalid="ignore"):
            return timed(lambda: component.run(start, self.setup.t_end, self.spec.step))

    def outcome(self, prepared: tuple[Splitting, np.ndarray], answer: SplittingRun) -> dict[str, Any]:
        return {
            "dofs": len(prepared[0].squares),
            "status": "ok" if answer.finite else "failed",
            "message": "" if answer.finite else "its displacements overflow",
            "steps": answer.steps,
        }


RUNNERS: Mapping[str, type[Runner]] = {
    "reduced": ReducedRunner,
    "user-object": BodyRunner,
    "full": FullRunner,
    "craig-bampton": CraigBamptonRunner,
    "solve-ivp": StepwiseRunner,
    "global-basis": GlobalBasisRunner,
    "pod-basis": TrainedBasisRunner,
    "splitting": SplittingRunner,
}
