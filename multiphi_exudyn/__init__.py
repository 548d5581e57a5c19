"""Multi-Phi: structures with contacts as piecewise-linear modal models, exact in time between events.

A structure (M, C, K, named points) and its contacts make levels, one for each set of closed contacts, each with its
own modes and asymptotic configuration; transitions carry the motion from level to level.
"""

from multiphi_exudyn.assemble import Assembly, assemble
from multiphi_exudyn.beam import Beam, Clamp, PointMass, planar_beam
from multiphi_exudyn.contact import UnilateralContact
from multiphi_exudyn.courses import Harmonic, Sampled, Smooth, Sweep
from multiphi_exudyn.errors import (
    MultiPhiError,
    MultiPhiTypeError,
    MultiPhiValueError,
    MultiPhiWarning,
    NumericalFailure,
)
from multiphi_exudyn.force_law import ForceLaw
from multiphi_exudyn.frequency_response import FrequencyResponse, frequency_response
from multiphi_exudyn.level import Level, LevelOverride
from multiphi_exudyn.loads import (
    BaseMotion,
    ConstantLoad,
    FunctionLoad,
    Gravity,
    HarmonicLoad,
    SampledLoad,
    StopMotion,
    SweepLoad,
)
from multiphi_exudyn.matrix_files import read_structure
from multiphi_exudyn.mode_choice import Tolerance, UpTo
from multiphi_exudyn.model import MultiPhiModel
from multiphi_exudyn.section import Section
from multiphi_exudyn.simulate import simulate
from multiphi_exudyn.state import Event
from multiphi_exudyn.steady_state import SteadyState, steady_state
from multiphi_exudyn.structure import LinearStructure, ModalDamping, RayleighDamping
from multiphi_exudyn.trajectory import Ledger, Trajectory
from multiphi_exudyn.truncation import truncation_indicator

__all__ = [
    "Assembly",
    "BaseMotion",
    "Beam",
    "Clamp",
    "ConstantLoad",
    "Event",
    "ForceLaw",
    "FrequencyResponse",
    "FunctionLoad",
    "Gravity",
    "Harmonic",
    "HarmonicLoad",
    "Ledger",
    "Level",
    "LevelOverride",
    "LinearStructure",
    "ModalDamping",
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
    "assemble",
    "frequency_response",
    "planar_beam",
    "read_structure",
    "simulate",
    "steady_state",
    "truncation_indicator",
]
