"""Scenes, runs of their models, and what comes out of comparing them; ``load`` gives a study's results as a table.

Order: results, wording, scene_tables, scene_elements, model_kinds, scene, setup, runs, runners, run_alone, needs,
measures, store, sweep, given_motions, judged_run, law_check, compare, details, plots, report, animation, budget,
study_file, accuracy, accuracy_report, stability.
"""

from multiphi_exudyn.study.results import load

__all__ = ["load"]
