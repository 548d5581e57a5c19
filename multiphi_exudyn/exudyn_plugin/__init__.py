"""Exudyn side: from an Exudyn system to a linear structure with contacts."""

from __future__ import annotations

from multiphi_exudyn.exudyn_plugin.linearize import LinearizedStructure, linear_structure_from

__all__ = ["LinearizedStructure", "linear_structure_from"]
