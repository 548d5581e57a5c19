"""Reliability: the effect of truncation on a run, and what to distrust in its result.

Order: defects, truncation, friction_warnings, law_warnings, impact_warnings, truncation_warnings, run_warnings.
"""
