"""What all models of a scene share: one (M, C, K), the contacts, force laws and friction, the start and the time grid.

The structure is the linearisation of the reference's full beams, so a reduced model and its reference
differ in nothing but the reduction, the geometric nonlinearity and the time integration.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.levels.level_override import LevelOverride
from multiphi_exudyn.levels.mode_choice import Tolerance
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.levels.static_equilibrium import Equilibrium
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.mechanics.planar_beam import beam_nodes
from multiphi_exudyn.mechanics.structure import LinearStructure
from multiphi_exudyn.study.scene.discretised import Mesh, discretised
from multiphi_exudyn.study.scene.fields import inside
from multiphi_exudyn.study.scene.model_kinds import (
    CraigBamptonModel,
    FullModel,
    ReducedModel,
    StepwiseModel,
    UserObjectModel,
)
from multiphi_exudyn.study.scene.parts import Mechanics
from multiphi_exudyn.study.scene.scene_file import DisplacedStart
from multiphi_exudyn.study.scene.scene_loads import loads_of
from multiphi_exudyn.study.scene.scenes import Scene, refuse
from reference_models.craig_bampton import independent_points
from reference_models.full_beam import FullBeam, FullBeamSettings
from reference_models.rig import published_override

__all__ = ["ELEMENTS", "ROUND_OFF", "Workbench", "mesh_nodes", "prepare", "start_configuration", "start_equilibrium"]

START_TOLERANCE = 1e-13  # of the force, between the last two steps of the search for it
START_ERROR = 1e-9  # of the displacement asked for; the full models are held to the same
REPEATS = 7
ROUND_OFF = 1 - 1e-9  # of the end of the run: a window nearer to it is the whole run
ELEMENTS = 57  # of a beam that no full model of the scene discretises; the paper's model has as many


@dataclass(frozen=True)
class Workbench:
    """A scene ready to run.

    structure: M, C, K and points. structure_s: what it took to get it [s]. time: (k,) the common grid [s].
    repeats: of a model's online part, for its time; more where it is short.
    """

    scene: Scene
    mechanics: Mechanics
    structure: LinearStructure
    structure_s: float
    time: np.ndarray
    repeats: int = REPEATS

    @functools.cached_property
    def longest_period(self) -> float:
        """Of the open level without force laws [s]; infinite where it has a rigid-body mode."""
        lowest = float(MultiPhiModel(self.structure, modes=1).level(()).frequencies[0])
        return 1 / lowest if lowest > 0 else math.inf

    @property
    def points(self) -> tuple[str, ...]:
        """The points whose histories are asked for."""
        return self.scene.file.outputs.points or self.mechanics.points

    @property
    def judged_points(self) -> tuple[str, ...]:
        """The points the headline figures speak of."""
        return self.scene.file.outputs.judged_points or self.points

    @property
    def t_end(self) -> float:
        """End of the run [s]: the last time of the grid."""
        return float(self.time[-1])

    @property
    def windows(self) -> tuple[float, ...]:
        """Ends [s] of the windows that differences are given for, ascending; the last is the end of the run."""
        named = sorted(self.scene.file.outputs.windows)
        return (*(until for until in named if until < ROUND_OFF * self.t_end), self.t_end)

    def contacts(self, rigid: bool) -> tuple[UnilateralContact, ...]:
        """The scene's contacts, as given or all of them rigid, along the stop too where they rub."""
        given, most = self.mechanics.contacts, math.inf
        ideal = (replace(contact, stiffness=most, damping=0.0, tangential_stiffness=most) for contact in given)
        return tuple(ideal) if rigid else given

    def nonlinearities(self, rigid: bool) -> tuple[UnilateralContact | ForceLaw | Friction, ...]:
        """The contacts, as given or all of them rigid, and the scene's force laws and friction."""
        return (*self.contacts(rigid), *self.mechanics.force_laws, *self.mechanics.frictions)

    @property
    def overrides(self) -> dict[tuple[str, ...], LevelOverride]:
        """Printed frequencies and ratios that replace the levels' own; none but for ``as-published``."""
        name = self.mechanics.parameter_set
        published = {} if name is None else published_override(name)
        return {level: LevelOverride(given.frequencies, given.ratios) for level, given in published.items()}

    @property
    def interface(self) -> tuple[str, ...]:
        """Points a Craig-Bampton component keeps: of contacts and outputs, those independent of each other."""
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
        along = self.mechanics.beams is not None and self.mechanics.needs_rigid_body_motion
        return loads_of(self.scene, discretised(_mesh(self.scene, self.mechanics))[0].transverse if along else None)

    def loads_on(self, beam: FullBeam) -> tuple[Load, ...]:
        """The scene's loads on a full beam's own mesh."""
        return loads_of(self.scene, beam.transverse)

    def model(self, spec: ReducedModel | UserObjectModel | StepwiseModel) -> MultiPhiModel:
        """The reduced model of a scene's entry."""
        tolerance = getattr(spec, "tolerance", None)
        modes = (spec.modes or "all") if tolerance is None else Tolerance(tolerance)
        return MultiPhiModel(self.structure, self.nonlinearities(spec.rigid), modes=modes, overrides=self.overrides)

    def full_beam(self, spec: FullModel) -> FullBeam:
        """The full model of a scene's entry."""
        given = self.mechanics
        assert given.beams is not None, "checked where the scene was loaded"
        settings = FullBeamSettings(
            kind=spec.beam,
            elements=spec.elements,
            step=spec.step,
            contact=spec.contact,
            spectral_radius=spec.spectral_radius,
            newton_tolerance=spec.newton_tolerance,
            output_step=self.scene.file.outputs.interval,
        )
        return FullBeam(given.beams, given.contacts, settings, given.force_laws, given.frictions)


def prepare(scene: Scene, mechanics: Mechanics) -> Workbench:
    """Build what the scene's models share; raises MultiPhiValueError naming file and field."""
    structure, elapsed = mechanics.matrices, 0.0
    if structure is None:
        beams, elapsed = discretised(_mesh(scene, mechanics))  # the same beams are linearised once for all scenes
        structure = beams.structure
    outputs = scene.file.outputs
    grid = outputs.interval * np.arange(round(outputs.t_end / outputs.interval) + 1)
    bench = Workbench(scene, mechanics, replace(structure, damping=mechanics.damping), elapsed, grid)
    _check_modes(bench)
    inside(f"{scene.path}: structure", lambda: bench.longest_period)  # refuses a structure that has no modes
    return bench


def start_configuration(bench: Workbench, model: MultiPhiModel) -> np.ndarray:
    """x (n,) at rest under the scene's static load, with the right contacts of ``model`` closed; zero without one."""
    return start_equilibrium(bench, model).displacement


def start_equilibrium(bench: Workbench, model: MultiPhiModel) -> Equilibrium:
    """The same, with the stretches of friction's springs under a load that has been applied slowly."""
    start = bench.scene.file.start
    if start is None:
        still = {model.links[k].name: 0.0 for k in model.held}
        return Equilibrium(np.zeros(bench.structure.n), still)
    if not isinstance(start, DisplacedStart):
        return model.equilibrium({start.load_at: start.force})
    row = bench.structure.row(start.measured_at)
    free = MultiPhiModel(bench.structure, modes=1).static_equilibrium({start.load_at: 1.0})
    needed = start.displacement / float(row @ free)

    def miss(share: float) -> float:
        """Of the displacement asked for, under a share of the force it needs without contact."""
        reached = row @ model.static_equilibrium({start.load_at: share * needed})
        return float(reached / start.displacement - 1)

    root = scipy.optimize.root_scalar(miss, method="secant", x0=0.0, x1=1.0, xtol=START_TOLERANCE)
    if not (root.converged and abs(miss(root.root)) <= START_ERROR):
        raise NumericalFailure(
            f"start: no force at {start.load_at} moves {start.measured_at} by {start.displacement:g} m"
        )
    return model.equilibrium({start.load_at: root.root * needed})


def mesh_nodes(scene: Scene, mechanics: Mechanics) -> dict[str, np.ndarray]:
    """Of every beam, node positions (k,) [m] of the mesh that a scene's structure is made from."""
    assert mechanics.beams is not None, "checked by who asks"
    elements = _mesh(scene, mechanics).elements
    return {name: beam_nodes(beam, elements) for name, beam in mechanics.beams.parts.items()}


def _mesh(scene: Scene, mechanics: Mechanics) -> Mesh:
    """The beams, and what discretises them: kind and elements of the reference, or of another full model."""
    full = [model for model in scene.models.values() if model.kind == "full"]
    named = [model for model in full if model.name == scene.file.comparison.reference]
    kind, elements = next(((model.beam, model.elements) for model in named or full), (None, ELEMENTS))
    assert mechanics.beams is not None, "a structure is beams or matrices"
    return Mesh.of(mechanics.beams, kind, elements)


def _check_modes(bench: Workbench) -> None:
    """No model has more modes than there are."""
    given = bench.mechanics.direction_count
    most = bench.structure.n - given
    if most < 1:
        raise MultiPhiValueError(
            f"{bench.scene.path}: structure: got {bench.structure.n} degrees of freedom and {given} contacts, "
            "frictions or force laws, need more degrees of freedom than those"
        )
    for model in bench.scene.models.values():
        if model.kind == "craig-bampton":
            _check_component(bench, model)
        elif model.kind != "full" and model.modes not in (None, "all") and int(model.modes) > most:
            refuse(bench.scene, f"modes of {model.name}", model.modes, f"at most {most} for this structure")


def _check_component(bench: Workbench, model: CraigBamptonModel) -> None:
    """Every contact on a coordinate of its own, and no more modes than are left."""
    interface = bench.interface
    missing = [name for name in bench.contact_points if name not in interface]
    if missing:
        refuse(bench.scene, f"kind of {model.name}", model.kind, f"another: point {missing[0]} follows from the others")
    most = bench.structure.n - len(interface)
    if model.modes > most:
        needed = f"at most {most} beside {len(interface)} interface points"
        refuse(bench.scene, f"modes of {model.name}", model.modes, needed)
