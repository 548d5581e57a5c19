"""Exudyn side: from an Exudyn system to a linear structure with contacts, and from a reduced model to a body.

On import the Create function is also bound to Exudyn's systems, as ``mbs.CreateMultiPhiBody(...)``, and SolveDynamic
checks what the bodies need of the solver.

Order: convert, coupling, body.
"""

from __future__ import annotations

from multiphi_exudyn.exudyn_plugin.body.binding import bind
from multiphi_exudyn.exudyn_plugin.body.body import MultiPhiBody
from multiphi_exudyn.exudyn_plugin.body.create import CreateMultiPhiBody
from multiphi_exudyn.exudyn_plugin.body.results.drawing import Drawing
from multiphi_exudyn.exudyn_plugin.body.results.sensors import BodyHistories, body_histories
from multiphi_exudyn.exudyn_plugin.body.solver.solving import install_checks
from multiphi_exudyn.exudyn_plugin.convert.items.items import Item
from multiphi_exudyn.exudyn_plugin.convert.linear_range.range_check import RangeCheck
from multiphi_exudyn.exudyn_plugin.convert.reduce import reduce
from multiphi_exudyn.exudyn_plugin.convert.reduction import Reduction
from multiphi_exudyn.exudyn_plugin.convert.structure.fem_interface import linear_structure_from_fem
from multiphi_exudyn.exudyn_plugin.convert.structure.linearize import linear_structure_from
from multiphi_exudyn.exudyn_plugin.convert.structure.linearized_structure import LinearizedStructure
from multiphi_exudyn.exudyn_plugin.coupling.interface_nodes import PositionInterface, RigidInterface

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
