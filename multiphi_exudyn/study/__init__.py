"""Scenes, runs of their models, and what comes out of comparing them; ``load`` gives a study's results as a table.

Order: results, scene_tables, scene_elements, model_kinds, scene, setup, running, measures, store, sweep, comparison,
accuracy, stability.
"""

from multiphi_exudyn.study.results import load

__all__ = ["load"]
