"""The report: one self-contained HTML page from a comparison, its pictures embedded."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from multiphi_exudyn.study.comparison import contact_plots, plots
from multiphi_exudyn.study.comparison.compare import Comparison
from multiphi_exudyn.study.comparison.contact_totals import LISTED, ContactTotals, contact_totals
from multiphi_exudyn.study.comparison.energy_plot import energy_figure
from multiphi_exudyn.study.comparison.findings import findings
from multiphi_exudyn.study.comparison.losses import LossTable
from multiphi_exudyn.study.comparison.mode_plots import mode_figure
from multiphi_exudyn.study.comparison.mode_shapes import LevelModes
from multiphi_exudyn.study.comparison.pages import environment_of
from multiphi_exudyn.study.comparison.zoom import histories_to_zoom
from multiphi_exudyn.study.measures import metrics
from multiphi_exudyn.study.scene.workbench import ROUND_OFF
from reference_models.rig import rig

__all__ = ["render"]

TEMPLATE = "report.html.j2"
ON_THE_PAGE = (
    "nrmse",
    "stiff_nrmse",
    "horizon",
    "horizon_s",
    "first_contact",
    "inner_losses",
    "closed_time",
    "impulse",
    "ledger",
)
HISTORY = (
    "{}: the whole run, {}and the largest difference to the reference up to each time. "
    "In the grey area a difference is no larger than the reference's to its own coarser copy."
)
MANY = "A bar is a time span in contact; contacts are numbered in the order of the scene."
FRICTION = "The force against the motion, and how far the patch has slipped on its counter-surface."
MODES = "Square: point mass. Triangle: closed contact, {}. All modes are scaled to the same largest value."
RIGID, COMPLIANT = "rigid, as in the published tables", "a spring of the scene's stiffness, so the point there moves"


@dataclass(frozen=True)
class Picture:
    """A figure as a data URI, with its place in the page and its caption."""

    section: str
    source: str
    caption: str


def render(comparison: Comparison, levels: Sequence[LevelModes], losses: Sequence[LossTable]) -> str:
    """The page as HTML."""
    environment, end = environment_of(__package__ or ""), ROUND_OFF * comparison.bench.t_end
    environment.filters["until"] = lambda given: "whole run" if given >= end else f"{given:.3f} s"
    return environment.get_template(TEMPLATE).render(
        comparison=comparison,
        bench=comparison.bench,
        scene=comparison.bench.scene,
        findings=findings(comparison),
        levels=levels,
        losses=losses,
        metrics=metrics,
        definitions=[metrics.METRICS[name] for name in ON_THE_PAGE],
        pictures=list(_pictures(comparison, levels)),
        totals=_totals(comparison),
        zoom=histories_to_zoom(comparison),
        contradiction=rig().contradiction if comparison.bench.mechanics.parameter_set else "",
    )


def _totals(comparison: Comparison) -> dict[str, ContactTotals]:
    """Of every model that ran, where the contacts are too many to be told of one by one."""
    if len(comparison.bench.mechanics.contacts) <= LISTED:
        return {}
    end = comparison.bench.t_end
    return {name: contact_totals(run, end) for name, run in comparison.runs.items() if run.ok}


def _pictures(comparison: Comparison, levels: Sequence[LevelModes]) -> Iterable[Picture]:
    if comparison.reference.ok:
        detail = "the first contact phase, " if comparison.reference.contact_intervals else ""
        for point in comparison.bench.points:
            yield _picture("histories", plots.history_figure(comparison, point), HISTORY.format(point, detail))
        yield _picture(
            "cost",
            plots.error_time_figure(comparison),
            "Lower left is better. In the grey band a model is as good as the reference can tell. "
            f"{'Hollow: rigid levels against stiff stops. ' if comparison.rigid else ''}"
            "Colours are the same in all pictures.",
        )
        yield from _contact_pictures(comparison)
        yield from _friction_pictures(comparison)
        yield _picture(
            "energy",
            energy_figure(comparison),
            "Where a bar ends below 100 %, time integration has lost energy; above, it has gained energy.",
        )
    if levels:
        rigid = comparison.bench.mechanics.parameter_set is not None
        yield _picture("modes", mode_figure(levels), MODES.format(RIGID if rigid else COMPLIANT))


def _contact_pictures(comparison: Comparison) -> Iterable[Picture]:
    """One for each of a few contacts, one for all of many."""
    contacts = comparison.reference.contact_intervals
    if len(contacts) > LISTED:
        yield _picture("contact", contact_plots.many_contacts_figure(comparison), MANY)
        return
    for contact in contacts:
        yield _picture("contact", contact_plots.contact_figure(comparison, contact), "A bar is a time span in contact.")


def _friction_pictures(comparison: Comparison) -> Iterable[Picture]:
    """One for each friction."""
    for name in comparison.reference.friction_force:
        yield _picture("friction", contact_plots.friction_figure(comparison, name), FRICTION)


def _picture(section: str, figure: Figure, caption: str) -> Picture:
    return Picture(section, plots.data_uri(figure), caption)
