"""Everything that ``import multiphi_exudyn as mp`` gives a name: the functions and classes of a user's script."""

from multiphi_exudyn.errors import (
    MultiPhiError,
    MultiPhiTypeError,
    MultiPhiValueError,
    MultiPhiWarning,
    NumericalFailure,
)
from multiphi_exudyn.levels.equilibrium.static_equilibrium import Equilibrium
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.levels.level.level_override import LevelOverride
from multiphi_exudyn.levels.model.mode_choice import Tolerance, UpTo
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.assembly import Assembly, assemble
from multiphi_exudyn.mechanics.beam import Beam, Clamp, PointMass, Section, planar_beam
from multiphi_exudyn.mechanics.condensed_structure import CondensedStructure, condensed_structure
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.files import read_structure
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.loads import (
    BaseMotion,
    ConstantLoad,
    FunctionLoad,
    Gravity,
    HarmonicLoad,
    SampledLoad,
    StopMotion,
    SweepLoad,
)
from multiphi_exudyn.mechanics.modal_structure import ModalStructure, structure_from_modes
from multiphi_exudyn.mechanics.structure import LinearStructure
from multiphi_exudyn.mechanics.time_functions import Accelerogram, Harmonic, Sampled, Smooth, Sweep
from multiphi_exudyn.steady.frequency_response import FrequencyResponse, frequency_response
from multiphi_exudyn.steady.steady_state import SteadyState, steady_state
from multiphi_exudyn.time.ledger import Ledger
from multiphi_exudyn.time.many import ManyRuns, simulate_many
from multiphi_exudyn.time.saved import SavedTrajectory, load_trajectory
from multiphi_exudyn.time.simulate import simulate
from multiphi_exudyn.time.state import Event
from multiphi_exudyn.time.trajectory import Trajectory
from multiphi_exudyn.time.truncation import truncation_indicator
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
