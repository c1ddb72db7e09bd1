"""`lagcli.report`: a model, what is known of it, its motion and its audit on one page."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import pathlib
from typing import Unpack

from lagcli import progress
from lagcli.api import animate, audit, cache, check, derive, run_settings, simulate
from lagcli.api.load import Path, as_model
from lagcli.errors import diagnostics
from lagcli.model import dimension_facts
from lagcli.model.model import Model
from lagcli.model.settings import RunSettings
from lagcli.output.animation import builder, page
from lagcli.output.figures import chart_figure, panels, result_figures
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
    # The audit is of the same run with more rows, where its own are too far apart to be judged.
    if len(run.rows) >= min(run.stats.steps // 2 + 1, audit.MOST_AUDITED):
        audited = audit.audit(model, run, events=run.events if model.inequality else None)
    else:
        audited = audit.audit(model)
    equations: PageEquations | str
    try:
        derived = derive.derive(model, limit=limit)
        equations = PageEquations(
            derived.html_sections(3), derived.markdown_sections(3), derived.latex_sections()
        )
    except diagnostics.ModelError as error:
        equations = "; ".join(one.message for one in error.diagnostics) + "."
    at_start, curves = _figures(model, run) if len(run.rows) else (None, None)
    parts = report_sections.ReportParts(
        model,
        title or model.title or pathlib.Path(model.path).stem,
        checked,
        run,
        audited,
        equations,
        at_start,
        curves,
        model_on_page.picture(
            "audit",
            result_figures.audit(audited, model.units.time),
            "The checks of the audit over time, each as a part of its limit.",
        ),
        step_tolerance.sentence(model.simulation),
    )
    return report_page.ReportPage(
        report_sections.contents(parts),
        audited.passed,
        None if run.stats.stopped is None else run.stats.stopped.reason,
    )


def _figures(model: Model, run: Trajectory) -> tuple[PageFigure | None, PageFigure]:
    """The first instant as `animate` draws it, None where there is nothing to be drawn; multipliers and reactions."""
    at_start = None
    with contextlib.suppress(builder.NothingToShow):
        animate.require_few(model)
        scene = animate.of_run(model, run)

        def first_picture() -> bytes:
            # Only LaTeX needs it.
            from lagcli.output.animation import film

            return film.picture(scene, "pdf")

        words = "The configuration at the start."
        at_start = model_on_page.PageFigure("start", "svg", page.svg(scene).encode(), words, first_picture)
    # The columns that are zero to rounding
    ready = cache.compiled(model)
    names = ("t", *ready.system.columns)
    floors = table_columns.Floors(ready.system, ready.numeric, initial.declared(ready.system).p, names)
    floors.take(run.rows[:, : len(names)])
    zeros = list(itertools.compress(names, floors.zeros()))
    marks = list(zip(run.events.t.tolist(), run.events.kinds, strict=True)) if len(run.events) else []
    facts = panels.PanelFacts(run.stats.indeterminate, zeros, dimension_facts.of(model), False, marks)
    drawn = chart_figure.compose_run(run.columns, run.rows, title="", units=model.units, facts=facts)
    return at_start, model_on_page.picture("forces", drawn, "Multipliers and constraint forces over time.")
