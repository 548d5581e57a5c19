"""What all models of a scene share: M, C, K, contacts, force laws, friction, start and time grid.

The structure is the linearisation of the reference's full beams, so a reduced model and its reference differ in nothing
but the reduction, the geometric nonlinearity and the time integration. Scenes without a full model have beams of linear
elements.
"""

from __future__ import annotations

import functools
import math
import time
from dataclasses import asdict, dataclass, replace

import numpy as np
import scipy.optimize

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.levels.equilibrium.static_equilibrium import Equilibrium
from multiphi_exudyn.levels.level.level_override import LevelOverride
from multiphi_exudyn.levels.model.mode_choice import Tolerance
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.assembly import Assembly, assemble
from multiphi_exudyn.mechanics.beam import Beam, Clamp, beam_nodes, planar_beam
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.mechanics.structure import LinearStructure
from multiphi_exudyn.study.model_kinds import (
    CraigBamptonModel,
    FullModel,
    ReducedModel,
    StepwiseModel,
    UserObjectModel,
)
from multiphi_exudyn.study.scene import Scene, loads_of, mechanics_of, refuse
from multiphi_exudyn.study.scene_elements import DisplacedStart
from multiphi_exudyn.study.scene_tables import Mechanics, inside
from reference_models.beams import Beams
from reference_models.craig_bampton import independent_points
from reference_models.full_beam import FullBeam, FullBeamSettings
from reference_models.rig import published_override

__all__ = [
    "ELEMENTS",
    "ROUND_OFF",
    "LinearBeams",
    "Setup",
    "mesh_nodes",
    "prepare",
    "start_configuration",
    "start_equilibrium",
]

START_TOLERANCE = 1e-13  # of the force, between the last two steps of its iteration
START_ERROR = 1e-9  # of the prescribed displacement; the same as for full models
REPEATS = 7
KEPT = 32  # discretised beams, a few matrices of some 100 DoFs each: the runs of a study share them
ROUND_OFF = 1 - 1e-9  # of the end of the run: a window that ends later is the whole run
ELEMENTS = 57  # of a beam in a scene without a full model, as in the paper's model


@dataclass(frozen=True)
class Setup:
    """A scene ready to run.

    structure: M, C, K and points. structure_s: time to build it [s]. time: (k,) the common grid [s].
    repeats: number of timed repeats of a run, more for a short one.
    """

    scene: Scene
    mechanics: Mechanics
    structure: LinearStructure
    structure_s: float
    time: np.ndarray
    repeats: int = REPEATS

    @functools.cached_property
    def longest_period(self) -> float:
        """Longest period of the open level without force laws [s]; infinite with a rigid-body mode."""
        lowest = float(MultiPhiModel(self.structure, modes=1).level(()).frequencies[0])
        return 1 / lowest if lowest > 0 else math.inf

    @property
    def points(self) -> tuple[str, ...]:
        """Points whose histories are recorded."""
        return self.scene.file.outputs.points or self.mechanics.points

    @property
    def judged_points(self) -> tuple[str, ...]:
        """Points that the headline figures refer to."""
        return self.scene.file.outputs.judged_points or self.points

    @property
    def t_end(self) -> float:
        """End of the run [s]: the last time of the grid."""
        return float(self.time[-1])

    @property
    def windows(self) -> tuple[float, ...]:
        """Ends [s] of the windows for differences, ascending; the last is the end of the run."""
        ends = sorted(self.scene.file.outputs.windows)
        return (*(until for until in ends if until < ROUND_OFF * self.t_end), self.t_end)

    def contacts(self, rigid: bool) -> tuple[UnilateralContact, ...]:
        """The scene's contacts, as given or all rigid, also tangentially."""
        contacts, most = self.mechanics.contacts, math.inf
        ideal = (replace(contact, stiffness=most, damping=0.0, tangential_stiffness=most) for contact in contacts)
        return tuple(ideal) if rigid else contacts

    def nonlinearities(self, rigid: bool) -> tuple[UnilateralContact | ForceLaw | Friction, ...]:
        """The contacts, as given or all of them rigid, and the scene's force laws and friction."""
        return (*self.contacts(rigid), *self.mechanics.force_laws, *self.mechanics.frictions)

    @property
    def overrides(self) -> dict[tuple[str, ...], LevelOverride]:
        """Printed frequencies and damping ratios that replace those of the levels; only for ``as-published``."""
        name = self.mechanics.parameter_set
        published = {} if name is None else published_override(name)
        return {level: LevelOverride(values.frequencies, values.ratios) for level, values in published.items()}

    @property
    def interface(self) -> tuple[str, ...]:
        """Interface points of a Craig-Bampton component: independent ones among contact and output points."""
        return independent_points(self.structure, dict.fromkeys([*self.contact_points, *self.points]))

    @property
    def contact_points(self) -> tuple[str, ...]:
        """Points that contacts act on, each once."""
        directions = [contact.direction for contact in self.mechanics.contacts]
        points = (name for at in directions for name in ([at] if isinstance(at, str) else at))
        return tuple(dict.fromkeys(points))

    @functools.cached_property
    def loads(self) -> tuple[Load, ...]:
        """The scene's loads on its structure."""
        needed = self.mechanics.beams is not None and self.mechanics.needs_rigid_body_motion
        return loads_of(self.scene, _discretised(self.scene, self.mechanics)[0].transverse if needed else None)

    def loads_on(self, beam: FullBeam) -> tuple[Load, ...]:
        """The scene's loads on a full beam's own mesh."""
        return loads_of(self.scene, beam.transverse)

    def model(self, spec: ReducedModel | UserObjectModel | StepwiseModel) -> MultiPhiModel:
        """The reduced model of a scene's entry."""
        tolerance = getattr(spec, "tolerance", None)
        modes = (spec.modes or "all") if tolerance is None else Tolerance(tolerance)
        elements, boundary = self.nonlinearities(spec.rigid), getattr(spec, "boundary", None)
        return MultiPhiModel(self.structure, elements, modes=modes, overrides=self.overrides, boundary=boundary)

    def full_beam(self, spec: FullModel) -> FullBeam:
        """The full model of a scene's entry."""
        mechanics = self.mechanics
        assert mechanics.beams is not None, "checked where the scene was loaded"
        settings = FullBeamSettings(
            kind=spec.beam,
            elements=spec.elements,
            step=spec.step,
            contact=spec.contact,
            spectral_radius=spec.spectral_radius,
            newton_tolerance=spec.newton_tolerance,
            output_step=self.scene.file.outputs.interval,
        )
        return FullBeam(mechanics.beams, mechanics.contacts, settings, mechanics.force_laws, mechanics.frictions)


def prepare(scene: Scene, mechanics: Mechanics | None = None) -> Setup:
    """Build what the models of a scene share; raises MultiPhiValueError with file and field.

    mechanics: in place of what the scene describes, as with more points on its beams.
    """
    mechanics = mechanics_of(scene) if mechanics is None else mechanics
    structure, elapsed = mechanics.matrices, 0.0
    if structure is None:
        beams, elapsed = _discretised(scene, mechanics)
        structure = beams.structure
    outputs = scene.file.outputs
    grid = outputs.interval * np.arange(round(outputs.t_end / outputs.interval) + 1)
    setup = Setup(scene, mechanics, replace(structure, damping=mechanics.damping), elapsed, grid)
    _check_modes(setup)
    inside(f"{scene.path}: structure", getattr, setup, "longest_period")  # an error for a structure without modes
    return setup


def start_configuration(setup: Setup, model: MultiPhiModel) -> np.ndarray:
    """Static response x (n,) to the scene's start load with the contacts of ``model``; zero without a start load."""
    return start_equilibrium(setup, model).displacement


def start_equilibrium(setup: Setup, model: MultiPhiModel) -> Equilibrium:
    """Equilibrium under the scene's start load, applied slowly: displacement and stretches of friction springs."""
    start = setup.scene.file.start
    if start is None:
        stretches = {model.links[k].name: 0.0 for k in model.held}
        return Equilibrium(np.zeros(setup.structure.n), stretches)
    if not isinstance(start, DisplacedStart):
        return model.equilibrium({start.load_at: start.force})
    row = setup.structure.row(start.measured_at)
    free = MultiPhiModel(setup.structure, modes=1).static_equilibrium({start.load_at: 1.0})
    free_force = start.displacement / float(row @ free)

    def deviation(share: float) -> float:
        """Relative deviation from the prescribed displacement, under ``share`` times the force without contact."""
        displacement = row @ model.static_equilibrium({start.load_at: share * free_force})
        return float(displacement / start.displacement - 1)

    root = scipy.optimize.root_scalar(deviation, method="secant", x0=0.0, x1=1.0, xtol=START_TOLERANCE)
    if not (root.converged and abs(deviation(root.root)) <= START_ERROR):
        raise NumericalFailure(
            f"start: no force at {start.load_at} moves {start.measured_at} by {start.displacement:g} m"
        )
    return model.equilibrium({start.load_at: root.root * free_force})


class LinearBeams:
    """Beams of linear elements. structure: M, K and points."""

    def __init__(self, beams: Beams, elements: int) -> None:
        self.beams = beams
        self.elements = elements
        parts = {name: planar_beam(beam, elements) for name, beam in beams.parts.items()}
        self.structure = parts[""] if beams.only is not None else assemble(parts, beams.ties)

    @functools.cached_property
    def transverse(self) -> np.ndarray:
        """e (n,), unit rigid-body motion along +z: M e is the inertia of the whole beams, see FullBeam.transverse."""
        inertia = np.concatenate([_inertia(beam, self.elements) for beam in self.beams.parts.values()])
        if isinstance(self.structure, Assembly):
            inertia = self.structure.transformation.T @ inertia
        return np.asarray(np.linalg.solve(self.structure.mass, inertia))


def _inertia(beam: Beam, elements: int) -> np.ndarray:
    """Inertia force (n,) on the free coordinates of a beam of linear elements under a unit acceleration."""
    free = planar_beam(replace(beam, clamp=Clamp(0.0, 0.0)), elements)
    inertia = free.mass[:, ::2].sum(axis=1)  # deflections and rotations alternate
    springs = (beam.clamp.translation, beam.clamp.rotation)
    return np.delete(inertia, [dof for dof, spring in enumerate(springs) if math.isinf(spring)])


def mesh_nodes(scene: Scene, beams: Beams) -> dict[str, np.ndarray]:
    """Node positions (k,) [m] of every beam in the mesh of the scene's structure."""
    return {name: beam_nodes(beam, _mesh(scene)[1]) for name, beam in beams.parts.items()}


def _mesh(scene: Scene) -> tuple[str | None, int]:
    """Kind of beam and number of elements of the reference, or of another full model; None: linear elements."""
    full = [model for model in scene.models.values() if model.kind == "full"]
    references = [model for model in full if model.name == scene.file.comparison.reference]
    return next(((model.beam, model.elements) for model in references or full), (None, ELEMENTS))


def _discretised(scene: Scene, mechanics: Mechanics) -> tuple[FullBeam | LinearBeams, float]:
    """The beams without contacts, and the time of their first computation [s]; the same beams are computed once."""
    assert mechanics.beams is not None, "a structure is beams or matrices"
    key = (repr(asdict(mechanics.beams)), *_mesh(scene))
    if key not in _computed:
        if len(_computed) >= KEPT:
            _computed.clear()
        started = time.perf_counter()
        _, kind, elements = key
        if kind is None:
            beams: FullBeam | LinearBeams = LinearBeams(mechanics.beams, elements)
        else:
            beams = FullBeam(mechanics.beams, (), FullBeamSettings(kind=kind, elements=elements))
        _computed[key] = beams, time.perf_counter() - started
    return _computed[key]


_computed: dict[tuple[str, str | None, int], tuple[FullBeam | LinearBeams, float]] = {}


def _check_modes(setup: Setup) -> None:
    """Check that no model has more modes than the structure."""
    directions = setup.mechanics.direction_count
    most = setup.structure.n - directions
    if most < 1:
        raise MultiPhiValueError(
            f"{setup.scene.path}: structure: got {setup.structure.n} degrees of freedom and {directions} contacts, "
            "frictions or force laws, need more degrees of freedom than those"
        )
    for model in setup.scene.models.values():
        if model.kind == "craig-bampton":
            _check_component(setup, model)
        elif model.kind != "full" and model.modes not in (None, "all") and int(model.modes) > most:
            refuse(setup.scene, f"modes of {model.name}", model.modes, f"at most {most} for this structure")


def _check_component(setup: Setup, model: CraigBamptonModel) -> None:
    """Check that every contact acts on an independent point, and the number of modes."""
    interface = setup.interface
    missing = [name for name in setup.contact_points if name not in interface]
    if missing:
        refuse(setup.scene, f"kind of {model.name}", model.kind, f"another: point {missing[0]} follows from the others")
    most = setup.structure.n - len(interface)
    if model.modes > most:
        needed = f"at most {most} beside {len(interface)} interface points"
        refuse(setup.scene, f"modes of {model.name}", model.modes, needed)
