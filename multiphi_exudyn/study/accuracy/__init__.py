"""How far answers can be trusted: parts of a difference, each with its cause and its own uncertainty.

Order: study_file, budget, study_result, analysis, cases, study, along_axis, map_figure, study_figures, budget_figure,
study_findings, study_report.
"""
