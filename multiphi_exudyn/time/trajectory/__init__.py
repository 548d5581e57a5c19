"""Trajectory: the answer of a run: histories at any time, contact forces, events, ledger; kept in a file.

Order: ledger, history_figure, histories, saved_arrays, saved, model_histories, final_state, trajectory.
"""
