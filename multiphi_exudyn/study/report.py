"""The report of a comparison: one self-contained HTML page, its sentences and its pictures from templates/."""

from __future__ import annotations

import base64
import json
import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.study import measures, plots
from multiphi_exudyn.study.compare import HIGH, MOST_LISTED, Comparison
from multiphi_exudyn.study.details import Details, coefficients
from multiphi_exudyn.study.measures import StiffStops
from multiphi_exudyn.study.plots import data_uri, first_contact_span, plotted_runs, styles
from multiphi_exudyn.study.runs import ModelRun
from multiphi_exudyn.study.setup import ROUND_OFF, Setup
from multiphi_exudyn.study.wording import engineering, faster, listed, percent, seconds, sentence, share, times
from multiphi_exudyn.time.model_warnings import grouped
from reference_models.rig import rig

__all__ = [
    "MAPS",
    "Picture",
    "comparison_warnings",
    "contact_totals",
    "embedded",
    "environment_of",
    "findings",
    "histories_to_zoom",
    "render",
    "run_warnings",
    "sentences",
]


@dataclass(frozen=True)
class Picture:
    """A figure as a data URI, with its caption."""

    source: str
    caption: str

    @classmethod
    def of(cls, figure: Figure, caption: str) -> Picture:
        """A figure, drawn."""
        return cls(data_uri(figure), caption)


def embedded(data: Any) -> Markup:
    """As JSON inside a script element, which no text in it can end."""
    return Markup(json.dumps(data).replace("<", "\\u003c"))


def html(frame: pd.DataFrame) -> Markup:
    """A table as a page has it, what it is of in its upper left corner (the name of its columns)."""
    return Markup(frame.to_html(border=0, index_names=frame.columns.name is not None))


FILTERS = (embedded, engineering, faster, html, listed, percent, seconds, sentence, share, times)


def environment_of() -> Environment:
    """The templates of all pages; those of HTML escape what is filled in."""
    environment = Environment(
        loader=PackageLoader("multiphi_exudyn.study"),
        autoescape=lambda name: ".html" in (name or ""),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {function.__name__: function for function in FILTERS}
    return environment


def sentences(template: str, parts: Iterable[str], **values: Any) -> dict[str, tuple[str, ...]]:
    """Of each macro among ``parts`` the paragraphs that these values leave: a sentence or two each, on one line."""
    module = environment_of().get_template(template).make_module(values)
    texts = {name: str(getattr(module, name)()) for name in parts}
    return {
        name: tuple(" ".join(paragraph.split()) for paragraph in text.split("\n\n") if paragraph.strip())
        for name, text in texts.items()
    }


def run_warnings(
    warnings: Sequence[tuple[str, Sequence[str]]], horizons: Sequence[tuple[str, Mapping[str, float]]], end: float
) -> list[str]:
    """A sentence for each kind of warning, and one where runs are not determined to their end [s].

    warnings: name of each run, and its own. horizons: name -> tolerance -> sensitivity horizon [s], of those asked.
    """
    told = [group.told(len(warnings)) for group in grouped(warnings)]
    known = [(until, tolerance, name) for name, each in horizons for tolerance, until in each.items()]
    early = [each for each in known if each[0] < ROUND_OFF * end]
    if not early:
        return told
    until, tolerance, name = min(early, key=lambda each: each[0])
    return [
        *told,
        f"sensitivity: {len(early)} of {len(known)} runs are not determined to their end: with a start changed by "
        f"1e-12 they differ by {share(float(tolerance))}, {name} from {until:.3g} s on; after that trust contact "
        "times and energies, not single values",
    ]


HEADLINE_ERROR = 0.01  # NRMSE that the headline's model meets, if any model does and the reference is certain enough
MOST_PLACES = 12  # points whose places are told
CURVE_TOLERANCE = 0.05  # NRMSE above which a pointwise comparison says little


def findings(comparison: Comparison) -> dict[str, tuple[str, ...]]:
    """Sentences by section: compared, outcome, distrust; and key_figures, each "quantity | value | source"."""
    setup, headline = comparison.setup, _headline_runs(comparison)
    cheapest = [run for run in comparison.cheapest if run.ok]
    best = _most_accurate(comparison, "reduced")
    return sentences(
        "comparison_findings.txt.j2",
        ("compared", "outcome", "distrust", "key_figures"),
        comparison=comparison,
        setup=setup,
        until=comparison.headline_window,
        start=setup.scene.file.start,
        loads=[f"the load {load.phrase()}" for load in setup.scene.file.loads],
        laws=[f"the force law {law.phrase()}" for law in setup.scene.file.force_laws],
        contacts=_contact_phrases(setup.mechanics.contacts),
        headline=headline,
        best=None if best in headline else best,
        failed=[run for run in comparison.runs.values() if not run.ok],
        cheapest=cheapest,
        cheapest_error=max((_error(comparison, run) for run in cheapest), default=math.inf),
        component=comparison.component_within(math.inf),
        component_as_accurate=lambda run: comparison.component_within(max(_error(comparison, run), _own(comparison))),
        unjudged=[name for name in setup.points if name not in setup.judged_points],
        own=comparison.coarser,
        places=_places(setup),
        load=comparison.environment.get("load_average", 0.0),
        cores=comparison.environment.get("cores", math.inf),
        early=list(_separated(comparison, [*headline, comparison.coarser])),
        followed=[(law, _displacements_beyond_span(comparison, law)) for law in setup.mechanics.force_laws],
        twins=list(_twins(comparison)),
        warnings=comparison_warnings(comparison),
    )


def comparison_warnings(comparison: Comparison) -> list[str]:
    """Warnings of the models about their own results, one sentence for each kind."""
    runs = comparison.runs.items()
    horizons = [(name, run.horizon_s) for name, run in runs]
    return run_warnings([(name, run.warnings) for name, run in runs], horizons, comparison.setup.t_end)


def _contact_phrases(contacts: Sequence[UnilateralContact]) -> list[str]:
    """A phrase for each contact, or one for all if there are many."""
    if len(contacts) > MOST_LISTED:
        return [
            f"{len(contacts)} contacts from {contacts[0].name} to {contacts[-1].name} "
            f"({_gap_and_stiffness_text(contacts)} each)"
        ]
    phrases = []
    for contact in contacts:
        points = list(coefficients(contact))
        between = f" between {listed(points)}" if len(points) == 2 else ""
        damping = f", {engineering(contact.damping)}N s/m" if contact.damping else ""
        phrases.append(f"the contact {contact.name}{between} ({_gap_and_stiffness_text([contact])}{damping})")
    return phrases


def _gap_and_stiffness_text(contacts: Sequence[UnilateralContact]) -> str:
    """Ranges of gap [mm] and stiffness of the contacts."""

    def span(values: Iterable[float], text: Callable[[float], str]) -> str:
        return " to ".join(dict.fromkeys([text(min(values)), text(max(values))]))

    gap = span([1e3 * contact.gap for contact in contacts], "{:g}".format)
    stiffness = [contact.stiffness for contact in contacts]
    return f"gap {gap} mm, {span(stiffness, lambda k: 'rigid' if math.isinf(k) else f'{engineering(k)}N/m')}"


def _places(setup: Setup) -> list[str]:
    """A phrase for each point that is named on a page: where it is on its beam; none of matrices, or of many points."""
    beams, start = setup.mechanics.beams, setup.scene.file.start
    started = [] if start is None else [start.load_at, getattr(start, "measured_at", start.load_at)]
    named = list(dict.fromkeys([*setup.points, *setup.contact_points, *started]))
    if beams is None or len(named) > MOST_PLACES:
        return []
    return [f"{name} {1e3 * beams.points[name][1]:g} mm" for name in named]


def _error(comparison: Comparison, run: ModelRun) -> float:
    """Worst error in the headline's window; infinite for a run without an error."""
    has_error = run.name in comparison.measured
    return comparison.worst_error(run, comparison.headline_window) if has_error else math.inf


def _own(comparison: Comparison) -> float:
    """The reference's own uncertainty in the headline's window; 0 where it is unknown."""
    own = comparison.coarser
    return 0.0 if own is None else _error(comparison, own)


def _most_accurate(comparison: Comparison, kind: str) -> ModelRun | None:
    runs = [run for run in comparison.measured.values() if run.kind == kind]
    return min(runs, key=lambda run: _error(comparison, run), default=None)


def _headline_runs(comparison: Comparison) -> list[ModelRun]:
    """Fastest accurate run of each kind (else its most accurate one), then the scene's first reduced model."""
    runs, floor = list(comparison.measured.values()), max(HEADLINE_ERROR, _own(comparison))
    names = []
    for kind in ("reduced", "user-object"):
        accurate = [run for run in runs if run.kind == kind and _error(comparison, run) <= floor]
        best = min(accurate, key=lambda run: run.online_s, default=_most_accurate(comparison, kind))
        names += [best.name] if best is not None else []
    first = [run.name for run in runs if run.kind == "reduced"][:1]
    return [comparison.runs[name] for name in dict.fromkeys([*names, *first])]


def _separated(comparison: Comparison, runs: Iterable[ModelRun | None]) -> Iterator[str]:
    """Name and time of the runs whose NRMSE exceeds CURVE_TOLERANCE before the end."""
    for run in runs:
        end = comparison.setup.t_end if run is None else comparison.horizon(run, CURVE_TOLERANCE)
        if run is not None and end < comparison.setup.t_end:
            yield f"{run.name} {end:.2f} s"


def _displacements_beyond_span(comparison: Comparison, law: ForceLaw) -> tuple[float, float] | None:
    """Range of the reference's displacement [mm] along a law, if it exceeds the law's span; else None.

    None also where the reference has not recorded all points of the law.
    """
    coefficients_of: dict[str, float] = {law.at: 1.0} if isinstance(law.at, str) else dict(law.at)
    points = comparison.reference.points
    if not coefficients_of.keys() <= points.keys():
        return None
    displacement = np.sum([factor * points[name] for name, factor in coefficients_of.items()], axis=0)
    lowest, highest = float(np.min(displacement)), float(np.max(displacement))
    return None if law.knots[0] <= lowest <= highest <= law.knots[-1] else (1e3 * lowest, 1e3 * highest)


def _twins(comparison: Comparison) -> Iterator[tuple[ModelRun, ModelRun, float]]:
    """Each user object, the same reduced model run alone, and the largest NRMSE of all points between them."""
    for run in comparison.runs.values():
        twin = comparison.twin(run)
        if twin is not None:
            points = comparison.setup.points
            errors = [measures.nrmse(run.points[p], twin.points[p], run.time, comparison.setup.t_end) for p in points]
            yield run, twin, max(errors)


DOTS = [2, 7]  # pixels of a dot and to the next


def histories_to_zoom(comparison: Comparison) -> list[dict[str, Any]]:
    """What templates/zoom.js draws: displacements of all points and forces of a few contacts, on one time axis.

    Of the reference and of the models drawn over it. shade: grey intervals; detail: what a button shows.
    """
    if not comparison.reference.ok:
        return []
    runs, contacts = [comparison.reference, *plotted_runs(comparison)], comparison.reference.contact_intervals
    detail, touched = list(first_contact_span(comparison)), measures.union(contacts.values()).tolist()
    drawn = [(f"{point} [mm]", touched, [1e3 * run.points[point] for run in runs]) for point in comparison.setup.points]
    if len(contacts) <= MOST_LISTED:
        drawn += [
            (f"force of {name} [N]", given.tolist(), [run.contact_force[name] for run in runs])
            for name, given in contacts.items()
        ]
    styled = [styles(comparison)[run.name] for run in runs]
    time = {"start": comparison.setup.time[0], "step": comparison.setup.time[1] - comparison.setup.time[0]}
    return [
        {
            "label": label,
            "x": time,
            "shade": shade,
            "detail": detail,
            "lines": [
                {
                    "name": run.name,
                    "colour": style.colour,
                    "width": style.width,
                    "dash": [] if style.line == "-" else DOTS,
                    "data": base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii"),
                }
                for run, style, values in zip(runs, styled, histories, strict=True)
            ],
        }
        for label, shade, histories in drawn
    ]


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
INITIAL = "The start: the static shape from which the structure is released. Square: point mass."
MAPS = (
    "The reference and {}. Dashed: natural frequencies of the levels [Hz]. Hatched: affected by the ends of the "
    "record. Grey bars on top: in contact."
)
LONG = "Reduced models, in milliseconds; above zero the motion comes round sooner than the open structure alone."
RIGID, COMPLIANT = "rigid, as in the published tables", "a spring of the scene's stiffness, so that its point moves"


def render(comparison: Comparison, details: Details) -> str:
    """Return the report of a comparison as an HTML page."""
    setup = comparison.setup
    contradiction = rig().contradiction if setup.mechanics.parameter_set else ""
    pictures = defaultdict[str, list[Picture]](list)
    for section, picture in _pictures(comparison, details):
        pictures[section].append(picture)
    return (
        environment_of()
        .get_template("report.html.j2")
        .render(
            name=setup.scene.name,
            title=setup.scene.file.title,
            findings=findings(comparison),
            definitions=[measures.METRICS[name] for name in ON_THE_PAGE],
            assumptions=[each for each in setup.mechanics.assumptions if each != contradiction],
            environment=comparison.environment,
            comparison=comparison,
            setup=setup,
            scene=setup.scene,
            levels=details.levels,
            losses=details.losses,
            courses=details.courses,
            basis=details.basis,
            high=HIGH,
            measures=measures,
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
    durations = measures.level_durations(run.contact_intervals, t_end)
    together = measures.union(run.contact_intervals.values())
    first = measures.first_contact(together)
    return {
        "contacts touched": sum(count > 0 for count in counts),
        "contacts made": sum(counts),
        "most at once": max(map(len, durations)),
        "sets of closed contacts": len(durations),
        "first contact": "–" if first is None else f"{1e3 * first:.3f} ms",
        "time with any contact": seconds(measures.closed_time(together)),
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


def _pictures(comparison: Comparison, details: Details) -> Iterator[tuple[str, Picture]]:
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
    if details.levels:
        rigid = comparison.setup.mechanics.parameter_set is not None
        yield "modes", Picture.of(plots.mode_figure(details.levels), MODES.format(RIGID if rigid else COMPLIANT))
    if details.initial:
        yield "initial", Picture.of(plots.initial_figure(comparison.setup, details.initial), INITIAL)
    if details.maps:
        yield "maps", Picture.of(plots.map_figure(details.maps), MAPS.format(details.maps[0].label))
    if details.courses:
        yield "long", Picture.of(plots.long_figure(details.courses), LONG)
