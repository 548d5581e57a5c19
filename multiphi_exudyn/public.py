"""Everything that ``import multiphi_exudyn as mp`` gives a name: the functions and classes of a user's script."""

from multiphi_exudyn.errors import (
    MultiPhiError,
    MultiPhiTypeError,
    MultiPhiValueError,
    MultiPhiWarning,
    NumericalFailure,
)
from multiphi_exudyn.events.transitions.state import Event
from multiphi_exudyn.levels.equilibrium.static_equilibrium import Equilibrium
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.levels.level.level_override import LevelOverride
from multiphi_exudyn.levels.model.mode_choice import Tolerance, UpTo
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.beams.beam import Beam, Clamp, PointMass
from multiphi_exudyn.mechanics.beams.planar_beam import planar_beam
from multiphi_exudyn.mechanics.beams.section import Section
from multiphi_exudyn.mechanics.elements.contact import UnilateralContact
from multiphi_exudyn.mechanics.elements.force_law import ForceLaw
from multiphi_exudyn.mechanics.elements.friction import Friction
from multiphi_exudyn.mechanics.files.matrix_files import read_structure
from multiphi_exudyn.mechanics.loads.loads import FunctionLoad, HarmonicLoad, SampledLoad, SweepLoad
from multiphi_exudyn.mechanics.loads.moving_supports import BaseMotion, StopMotion
from multiphi_exudyn.mechanics.loads.samples import Accelerogram, Sampled
from multiphi_exudyn.mechanics.loads.static_loads import ConstantLoad, Gravity
from multiphi_exudyn.mechanics.loads.time_functions import Harmonic, Smooth, Sweep
from multiphi_exudyn.mechanics.structures.assembly import Assembly, assemble
from multiphi_exudyn.mechanics.structures.condensed_structure import CondensedStructure, condensed_structure
from multiphi_exudyn.mechanics.structures.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.structures.modal_structure import ModalStructure, structure_from_modes
from multiphi_exudyn.mechanics.structures.structure import LinearStructure
from multiphi_exudyn.steady.frequency_response import FrequencyResponse, frequency_response
from multiphi_exudyn.steady.settled_state import SteadyState
from multiphi_exudyn.steady.steady_state import steady_state
from multiphi_exudyn.time.many.many import ManyRuns, simulate_many
from multiphi_exudyn.time.reliability.truncation import truncation_indicator
from multiphi_exudyn.time.simulate import simulate
from multiphi_exudyn.time.trajectory.ledger import Ledger
from multiphi_exudyn.time.trajectory.saved import SavedTrajectory, load_trajectory
from multiphi_exudyn.time.trajectory.trajectory import Trajectory
from multiphi_exudyn.version import __version__

__all__ = [
    "Accelerogram",
    "Assembly",
    "BaseMotion",
    "Beam",
    "Clamp",
    "CondensedStructure",
    "ConstantLoad",
    "Equilibrium",
    "Event",
    "ForceLaw",
    "FrequencyResponse",
    "Friction",
    "FunctionLoad",
    "Gravity",
    "Harmonic",
    "HarmonicLoad",
    "Ledger",
    "Level",
    "LevelOverride",
    "LinearStructure",
    "ManyRuns",
    "ModalDamping",
    "ModalStructure",
    "MultiPhiError",
    "MultiPhiModel",
    "MultiPhiTypeError",
    "MultiPhiValueError",
    "MultiPhiWarning",
    "NumericalFailure",
    "PointMass",
    "RayleighDamping",
    "Sampled",
    "SampledLoad",
    "SavedTrajectory",
    "Section",
    "Smooth",
    "SteadyState",
    "StopMotion",
    "Sweep",
    "SweepLoad",
    "Tolerance",
    "Trajectory",
    "UnilateralContact",
    "UpTo",
    "__version__",
    "assemble",
    "condensed_structure",
    "frequency_response",
    "load_trajectory",
    "planar_beam",
    "read_structure",
    "simulate",
    "simulate_many",
    "steady_state",
    "structure_from_modes",
    "truncation_indicator",
]
