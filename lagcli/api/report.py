"""`lagcli.report`: a model, what is known of it, its motion and its audit on one page."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Unpack

from lagcli import progress
from lagcli.api import animate, audit, check, derive, simulate
from lagcli.api.models import cache
from lagcli.api.models.load import Path, as_model
from lagcli.api.runs import run_settings
from lagcli.auditing.checks.audit_report import Audit
from lagcli.errors import diagnostics
from lagcli.model import dimension_facts
from lagcli.model.model import Model
from lagcli.model.settings import RunSettings
from lagcli.output.animation import builder, page
from lagcli.output.animation.scene import Scene
from lagcli.output.charts import chart_figure
from lagcli.output.figures import audit_figure, panels
from lagcli.reporting import model_on_page, report_page, report_sections
from lagcli.reporting.model_on_page import PageEquations, PageFigure
from lagcli.reporting.report_page import ReportPage
from lagcli.running import table_columns
from lagcli.running.trajectory import Trajectory
from lagcli.simulation.scheme import step_tolerance
from lagcli.start import initial


@progress.phase("writing the report")
@run_settings.keywords()
def report(
    model: Model | Path,
    *,
    title: str | None = None,
    digits: bool = False,
    limit: float | None = None,
    **settings: Unpack[RunSettings],
) -> ReportPage:
    """Return the page of a model: its text, verdicts with proofs, count, equations, motion, audit and provenance.

    What is None is as the model says; `title` stands in place of the model's; `digits` repeats the run to count right
    digits; `limit`: the seconds for proofs, and for the equations. The object has `html()`, `markdown(folder)`,
    `save(path)`; a run that stops before its end and an audit that fails are shown on the page, and as `stopped` and
    `passed`. Raises `ModelError` where the model is invalid or its start inconsistent, `ValueError` for bad options.
    """

    model = as_model(model)
    model = dataclasses.replace(model, simulation=run_settings.chosen(model, settings))
    checked = check.check(model, limit=limit)
    run, _ = simulate.as_far(model, digits=digits, limit=limit)
    audited = _audited(model, run)
    parts = report_sections.ReportParts(
        model,
        title or model.title or pathlib.Path(model.path).stem,
        checked,
        run,
        audited,
        _equations(model, limit),
        _still(model, run),
        _curves(model, run),
        _checks(audited, model.units.time),
        step_tolerance.sentence(model.simulation),
    )
    return report_page.ReportPage(
        report_sections.contents(parts),
        audited.passed,
        None if run.stats.stopped is None else run.stats.stopped.reason,
    )


def _audited(model: Model, run: Trajectory) -> Audit:
    """The audit of the run, or of the same run with more rows, where its own are too far apart to be judged."""
    stats = run.stats
    if len(run.rows) >= min(stats.steps // 2 + 1, audit.MOST_AUDITED):
        return audit.audit(model, run, events=run.events if model.inequality else None)
    return audit.audit(model)


def _equations(model: Model, limit: float | None) -> PageEquations | str:
    """The equations, or why they are not written."""

    try:
        found = derive.derive(model, limit=limit)
    except diagnostics.ModelError as error:
        return "; ".join(one.message for one in error.diagnostics) + "."
    return PageEquations(found.html_sections(3), found.markdown_sections(3), found.latex_sections())


def _still(model: Model, run: Trajectory) -> PageFigure | None:
    """The first instant as `animate` draws it; None where there is nothing to be drawn."""
    if not len(run.rows):
        return None

    try:
        animate.require_few(model)
        scene = animate.of_run(model, run)
    except builder.NothingToShow:
        return None
    words = "The configuration at the start."
    return model_on_page.drawing("start", page.svg(scene), words, lambda: _first_picture(scene))


def _first_picture(scene: Scene) -> bytes:
    """The first instant as PDF."""
    # Only LaTeX needs it.
    from lagcli.output.animation import film

    return film.picture(scene, "pdf")


def _curves(model: Model, run: Trajectory) -> PageFigure | None:
    """The figure of multipliers and reactions."""
    if not len(run.rows):
        return None

    marks = list(zip(run.events.t.tolist(), run.events.kinds, strict=True)) if len(run.events) else []
    facts = panels.PanelFacts(
        run.stats.indeterminate, _zeros(model, run), dimension_facts.of(model), False, marks
    )
    drawn = chart_figure.compose_run(run.columns, run.rows, title="", units=model.units, facts=facts)
    return model_on_page.picture("forces", drawn, "Multipliers and constraint forces over time.")


def _zeros(model: Model, run: Trajectory) -> list[str]:
    """The columns that are zero to rounding."""
    ready = cache.compiled(model)
    names = ("t", *ready.system.columns)
    floors = table_columns.Floors(ready.system, ready.numeric, initial.declared(ready.system).p, names)
    floors.take(run.rows[:, : len(names)])
    return [name for name, is_zero in zip(names, floors.zeros(), strict=True) if is_zero]


def _checks(found: Audit, time: str) -> PageFigure:
    """The figure of the audit."""

    words = "The checks of the audit over time, each as a part of its limit."
    return model_on_page.picture("audit", audit_figure.compose(found, time), words)
