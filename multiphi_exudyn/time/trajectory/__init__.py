"""Trajectory: the result of a run: histories at any time, contact forces, events, ledger; saved in a file.

Order: ledger, history_figure, histories, saved_arrays, saved, model_histories, final_state, trajectory.
"""
