"""Models side by side: compared, drawn and reported.

Order: wording, compare, beam_places, figure_style, losses, mode_shapes, plots, zoom, pages, run_warnings, findings,
report, animation.
"""
