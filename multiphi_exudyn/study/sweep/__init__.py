"""Sweeps that lose nothing: one function over many cases, each finished run a row of a file.

Order: time_limit, log, row, store, executors, run, sweep.
"""

from __future__ import annotations

from multiphi_exudyn.study.sweep.executors import open_executor
from multiphi_exudyn.study.sweep.row import Row
from multiphi_exudyn.study.sweep.run import Outcome
from multiphi_exudyn.study.sweep.store import Store
from multiphi_exudyn.study.sweep.sweep import grid, sweep

__all__ = ["Outcome", "Row", "Store", "grid", "open_executor", "sweep"]
