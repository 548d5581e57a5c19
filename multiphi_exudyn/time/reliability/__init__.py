"""Reliability: what truncation could not hold, and what to distrust in an answer.

Order: defects, truncation, friction_warnings, impact_warnings, truncation_warnings, run_warnings.
"""
