"""All models of one scene side by side: figures, findings, report.

Order: wording, pages, placement, compare, warned, contact_totals, losses, mode_shapes, direct_labels, plots,
energy_plot, mode_plots, contact_plots, zoom, animation, findings, report.
"""
