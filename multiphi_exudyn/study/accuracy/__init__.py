"""How far answers can be trusted: parts of a difference, each with its cause and its own uncertainty.

Order: study_file, budget, study_result, analysis, cases, study, study_table, study_warnings, stiff_errors,
along_axis, indicator, figure_style, map_figure, overview, study_zoom, study_figures, budget_figure,
study_findings, study_report.
"""
