"""The report: one self-contained HTML page from a comparison, its pictures embedded."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence

import pandas as pd

from multiphi_exudyn.study.comparison import plots
from multiphi_exudyn.study.comparison.compare import MOST_LISTED, Comparison
from multiphi_exudyn.study.comparison.findings import findings
from multiphi_exudyn.study.comparison.mode_shapes import LevelModes, mode_figure
from multiphi_exudyn.study.comparison.pages import Picture, environment_of
from multiphi_exudyn.study.comparison.wording import percent, seconds, share
from multiphi_exudyn.study.comparison.zoom import histories_to_zoom
from multiphi_exudyn.study.measures import metrics
from multiphi_exudyn.study.measures.stiff_stops import StiffStops
from multiphi_exudyn.study.running.runs import ModelRun
from multiphi_exudyn.study.setup import ROUND_OFF
from reference_models.rig import rig

__all__ = ["contact_totals", "render"]

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
    "Differences in the grey area are no larger than that between the reference and its coarser copy."
)
COST = "Lower left is better. Errors in the grey band are below the uncertainty of the reference. {}"
HOLLOW = "Hollow markers: error of rigid levels against stiff stops. "
CONTACT = "Each bar is a contact interval."
MANY = "Each bar is a contact interval; contacts are numbered in the order of the scene."
FRICTION = "Friction force, and how far the patch has slipped on its counter-surface."
ENERGY = "A bar that ends below 100 % shows energy lost by time integration, above 100 % energy gained."
MODES = "Square: point mass. Triangle: closed contact, {}. All modes are scaled to the same largest value."
RIGID, COMPLIANT = "rigid, as in the published tables", "a spring of the scene's stiffness, so that its point moves"


def render(comparison: Comparison, levels: Sequence[LevelModes], losses: Mapping[str, pd.DataFrame]) -> str:
    """Return the report of a comparison as an HTML page."""
    setup = comparison.setup
    contradiction = rig().contradiction if setup.mechanics.parameter_set else ""
    pictures = defaultdict[str, list[Picture]](list)
    for section, picture in _pictures(comparison, levels):
        pictures[section].append(picture)
    return (
        environment_of(__package__ or "")
        .get_template(TEMPLATE)
        .render(
            name=setup.scene.name,
            title=setup.scene.file.title,
            findings=findings(comparison),
            definitions=[metrics.METRICS[name] for name in ON_THE_PAGE],
            assumptions=[each for each in setup.mechanics.assumptions if each != contradiction],
            environment=comparison.environment,
            comparison=comparison,
            setup=setup,
            scene=setup.scene,
            levels=levels,
            losses=losses,
            metrics=metrics,
            errors=_errors(comparison),
            stiff_errors=_stiff_errors(comparison, comparison.stiff) if comparison.stiff and comparison.rigid else None,
            pictures=pictures,
            totals=contact_totals(comparison) if len(setup.mechanics.contacts) > MOST_LISTED else None,
            zoom=histories_to_zoom(comparison),
            contradiction=contradiction,
        )
    )


def contact_totals(comparison: Comparison) -> pd.DataFrame:
    """Totals over all contacts, one row for each run that is ok."""
    return pd.DataFrame(
        {name: _totals(run, comparison.setup.t_end) for name, run in comparison.runs.items() if run.ok}
    ).T


def _totals(run: ModelRun, t_end: float) -> dict[str, object]:
    counts = [len(intervals) for intervals in run.contact_intervals.values()]
    durations = metrics.level_durations(run.contact_intervals, t_end)
    together = metrics.union(run.contact_intervals.values())
    first = metrics.first_contact(together)
    return {
        "contacts touched": sum(count > 0 for count in counts),
        "contacts made": sum(counts),
        "most at once": max(map(len, durations)),
        "sets of closed contacts": len(durations),
        "first contact": "–" if first is None else f"{1e3 * first:.3f} ms",
        "time with any contact": seconds(metrics.closed_time(together)),
        "impulse of all": f"{sum(run.impulse.values()):.4g} N s" if run.impulse else "–",
    }


def _errors(comparison: Comparison) -> pd.DataFrame:
    """Errors by window and point, agreement horizons and sensitivity horizons, one row for each run."""
    end, tolerances = comparison.setup.t_end, comparison.setup.scene.file.outputs.tolerances

    def horizon_text(time: float | None) -> str:
        return "–" if time is None else "whole run" if time >= ROUND_OFF * end else f"{time:.3f} s"

    lines = {}
    for name, run in comparison.measured.items():
        agreement = {
            ("agreement horizon", share(each)): horizon_text(comparison.horizon(run, each)) for each in tolerances
        }
        sensitivity = {each: horizon_text(run.horizon_s.get(each)) for each in comparison.horizon_tolerances}
        sensitivity_columns = {("sensitivity horizon", share(float(each))): text for each, text in sensitivity.items()}
        lines[name] = _by_window(comparison.errors(run)) | agreement | sensitivity_columns
    return pd.DataFrame(lines).T


def _stiff_errors(comparison: Comparison, stiff: StiffStops) -> pd.DataFrame:
    """Errors of rigid levels against stiff stops, and the uncertainty of this reference."""
    values = stiff.values(comparison.setup, comparison.rigid)
    tables = values["errors"] | {"own uncertainty": values["uncertainty"]}
    return pd.DataFrame({name: _by_window(table) for name, table in tables.items()}).T


def _by_window(table: Mapping[str, Mapping[str, float | None]]) -> dict[tuple[str, str], str]:
    """Columns (window, point) of errors as text."""
    return {(f"to {end} s", point): percent(error) for end, errors in table.items() for point, error in errors.items()}


def _pictures(comparison: Comparison, levels: Sequence[LevelModes]) -> Iterator[tuple[str, Picture]]:
    """Pairs of a section's name and a picture."""
    reference = comparison.reference
    if reference.ok:
        detail = "the first contact phase, " if reference.contact_intervals else ""
        for point in comparison.setup.points:
            yield "histories", Picture.of(plots.history_figure(comparison, point), HISTORY.format(point, detail))
        cost = COST.format(HOLLOW if comparison.rigid else "")
        yield "cost", Picture.of(plots.error_time_figure(comparison), cost)
        if len(reference.contact_intervals) > MOST_LISTED:
            yield "contact", Picture.of(plots.many_contacts_figure(comparison), MANY)
        else:
            for contact in reference.contact_intervals:
                yield "contact", Picture.of(plots.contact_figure(comparison, contact), CONTACT)
        for friction in reference.friction_force:
            yield "friction", Picture.of(plots.friction_figure(comparison, friction), FRICTION)
        yield "energy", Picture.of(plots.energy_figure(comparison), ENERGY)
    if levels:
        rigid = comparison.setup.mechanics.parameter_set is not None
        yield "modes", Picture.of(mode_figure(levels), MODES.format(RIGID if rigid else COMPLIANT))
