"""Reliability: the effect of truncation on a run, and what to distrust in its result.

Order: defects, truncation_warnings, truncation, friction_warnings, impact_warnings, law_span, law_warnings,
ledger_warnings, far_rest, run_warnings.
"""
