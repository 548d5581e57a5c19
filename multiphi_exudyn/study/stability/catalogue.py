"""The shipped catalogue, in the order of its table."""

from __future__ import annotations

from multiphi_exudyn.study.stability import beams, driven, friction, laws, starts, systems

__all__ = ["CATALOGUE"]

CATALOGUE = (*starts.CASES, *beams.CASES, *systems.CASES, *laws.CASES, *driven.CASES, *friction.CASES)
