"""`lagcli audit`: a second opinion on a run, printed, drawn, or as JSON."""

from __future__ import annotations

import os
import textwrap
from typing import TYPE_CHECKING, Annotated

from lagcli.cli.commands import options
from lagcli.cli.terminal import console, exits
from lagcli.errors import diagnostics
from lagcli.model.settings import RunSettings
from lagcli.output.files import formats, write_guard

if TYPE_CHECKING:
    from lagcli.auditing.checks.audit_report import Audit

LEAST_WHERE = 12  # columns of the terminal for the location of the worst entry


@options.command()
def audit(
    model: options.ModelArgument,
    run: Annotated[str | None, options.file(f"a table: {formats.LISTED}; else a new run")] = None,
    events: Annotated[str | None, options.file("the events of that run, of `simulate --events`")] = None,
    plot: Annotated[str | None, options.file("figure of the checks: png, svg, pdf")] = None,
    *,
    run_settings: RunSettings,
    digits: Annotated[bool, "how many digits of the table are right, from the run repeated"] = False,
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
) -> None:
    """Check a table of t, r, v, lambda, R against the laws of the model, without the functions of the solver.

    Exit 1 where a check fails, 3 where the new run stops before its end.
    """
    write_guard.require_endings((plot, formats.FIGURES), (run, formats.TABLES))
    if run is not None and not os.path.exists(run):
        raise exits.UsageError(f"--run: there is no file {run}")
    if events is not None:
        write_guard.require_endings((events, formats.TABLES))
        if run is None:
            raise exits.UsageError("--events: the incidents are of the table of --run, which is missing")
        if not os.path.exists(events):
            raise exits.UsageError(f"--events: there is no file {events}")
    if plot is not None:
        files = [("MODEL", model), ("--run", run), ("--events", events)]
        write_guard.require(files, ("--plot", plot, formats.FIGURES))
    rows_given = (run_settings.get(name) for name in ("duration", "samples", "output_step"))
    if run is not None and any(value is not None for value in rows_given):
        raise exits.UsageError(
            "--run: the table has its own rows; --duration, --samples and --output-step are of a new run"
        )
    read = options.read(model, changes, as_json)
    from lagcli.api import audit as auditing
    from lagcli.auditing.evidence.table_input import TableError
    from lagcli.output.tables import incident_table

    incidents = None
    if events is not None:
        with options.reading(events, "--events"):
            incidents = incident_table.read(events)
    with (
        options.refusals(as_json),
        options.stops("audit"),
        options.reading(str(run), "--run"),
    ):
        try:
            found = auditing.audit(read, run, digits=digits, events=incidents, **run_settings)
        except TableError as error:
            raise exits.UsageError(f"--run {run}: {error}") from None
    if plot is not None:
        with write_guard.drawing(plot):
            from lagcli.output.figures import figure_page, result_figures

            figure_page.write(plot, result_figures.audit(found, read.units.time))
    if as_json:
        print(formats.json_line(found.as_json()))
    else:
        _print_report(found, verbose)
    exits.print_notes(found.notes, quiet)
    if not found.passed:
        raise exits.Exit(exits.INVALID)
    if not found.complete:
        raise exits.Exit(exits.STOPPED)


def _print_report(found: Audit, verbose: bool) -> None:
    """The report: a table of checks, what fails by name, and what the rows determine uniquely."""
    from lagcli.auditing.checks import audit_report
    from lagcli.output.figures import labels

    name, report = labels.shortened(found.title or found.path, labels.TITLE), audit_report.lines(found)
    rows = f"{found.rows} rows from t = {found.start:g} to {found.end:g}"
    console.paragraph(f"Audit of {name}: {rows}, run to rtol {found.rtol:g}, atol {found.atol:g}", "")
    # The lines of the table; on a narrow terminal laws are named by their numbers alone
    lines = report.rows
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    if sum(widths) + 2 * (len(widths) - 1) > console.width():
        laws = ["law", *(check.law for check in found.checks)]
        lines = [(line[0], law, *line[2:]) for line, law in zip(lines, laws, strict=True)]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        room = console.width() - sum(widths[:-1]) - 2 * (len(widths) - 1)
        widths[-1] = max(LEAST_WHERE, min(widths[-1], room))
    table = []
    notes = ["", *(check.note if verbose or check.name == "momenta" else "" for check in found.checks)]
    for line, note in zip(lines, notes, strict=True):
        last = textwrap.wrap(line[-1], widths[-1], break_on_hyphens=False) or [""]
        cells = [cell.ljust(width) for cell, width in zip(line[:-1], widths[:-1], strict=True)]
        table.append("  ".join([*cells, last[0]]).rstrip())
        table += [" " * (sum(widths[:-1]) + 2 * len(cells)) + part for part in last[1:]]
        for part in note.split("; ") if note else ():
            table += textwrap.wrap(part, console.width(), initial_indent="    ", subsequent_indent="      ")
    print("", *map(diagnostics.printable, table), "", sep="\n")
    for head, faults, others in report.failures:
        console.paragraph(head, "  ")
        for fault in faults:
            console.paragraph(f"  {fault}")
        if others:
            print(f"  and {others} others")
    for sentence in report.sentences:
        console.paragraph(sentence, "")
