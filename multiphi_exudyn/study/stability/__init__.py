"""Stability: a catalogue of extreme cases, every model run through each of them, and what each answer is worth.

Order: case, outcome, brute_force, run_signals, run_laws, judgement, structures, starts,
beams, laws, driven, friction, systems, native_run, exudyn_runs, catalogue_run, summary, report.
"""
