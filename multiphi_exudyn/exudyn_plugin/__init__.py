"""Exudyn side: from an Exudyn system to a linear structure with contacts, and from a reduced model to a body.

On import the Create function is also bound to Exudyn's systems, as ``mbs.CreateMultiPhiBody(...)``, and SolveDynamic
checks what the bodies need of the solver.

Order: items, system, contacts, timed, matrices, start_state, linear_range, linearize, fem_interface, reduce,
discretised_level, interface, own_loads, state, step_test, coupled, alone, body, solver, sensors, drawing, create.
"""

from __future__ import annotations

from multiphi_exudyn.exudyn_plugin.body import MultiPhiBody
from multiphi_exudyn.exudyn_plugin.create import CreateMultiPhiBody, bind
from multiphi_exudyn.exudyn_plugin.drawing import Drawing
from multiphi_exudyn.exudyn_plugin.fem_interface import linear_structure_from_fem
from multiphi_exudyn.exudyn_plugin.interface import PositionInterface, RigidInterface
from multiphi_exudyn.exudyn_plugin.items import Item
from multiphi_exudyn.exudyn_plugin.linear_range import RangeCheck
from multiphi_exudyn.exudyn_plugin.linearize import LinearizedStructure, linear_structure_from
from multiphi_exudyn.exudyn_plugin.reduce import Reduction, reduce
from multiphi_exudyn.exudyn_plugin.sensors import BodyHistories, body_histories
from multiphi_exudyn.exudyn_plugin.solver import install_checks

__all__ = [
    "BodyHistories",
    "CreateMultiPhiBody",
    "Drawing",
    "Item",
    "LinearizedStructure",
    "MultiPhiBody",
    "PositionInterface",
    "RangeCheck",
    "Reduction",
    "RigidInterface",
    "body_histories",
    "linear_structure_from",
    "linear_structure_from_fem",
    "reduce",
]

bind(CreateMultiPhiBody)
install_checks()
