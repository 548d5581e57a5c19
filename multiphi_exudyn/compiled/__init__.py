"""The compiled loop of a run: the same motion and the same event rule as simulate.py and event_rule.py, in numba."""
