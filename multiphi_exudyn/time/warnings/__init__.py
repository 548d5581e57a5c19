"""Warnings: their issue to users, and those that are known before a run.

Order: warning_groups, base_warnings, model_warnings.
"""
