"""The compiled loop of a run: the same motion and the same event rule as motion.py and events/rule.py, in numba.

Order: waves, pack, search, decision, kernel, record, loop.
"""
