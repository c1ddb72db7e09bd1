"""`lagcli audit`: a second opinion on a run, printed, drawn, or as JSON."""

from __future__ import annotations

import dataclasses
import os
import textwrap
from typing import TYPE_CHECKING, Annotated

import typer

from lagcli.cli.commands import model_reading, options
from lagcli.cli.terminal import console, exits
from lagcli.errors import diagnostics
from lagcli.model.settings import RunSettings
from lagcli.output.files import file_requests, formats, json_text, write_guard

if TYPE_CHECKING:
    from lagcli.auditing.checks.audit_report import Audit, Check
    from lagcli.model.model import Model
    from lagcli.output.tables.incident_table import IncidentTable


LEAST_WHERE = 12  # columns of the terminal for the location of the worst entry


@exits.command
@options.with_run_settings()
def audit(
    model: options.ModelArgument,
    run: Annotated[
        str | None,
        typer.Option("--run", metavar="FILE", help=f"a table: {formats.LISTED}; else a new run"),
    ] = None,
    events: Annotated[
        str | None,
        typer.Option("--events", metavar="FILE", help="the events of that run, of `simulate --events`"),
    ] = None,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="figure of the checks: png, svg, pdf")
    ] = None,
    *,
    run_settings: RunSettings,
    digits: Annotated[
        bool, typer.Option("--digits", help="how many digits of the table are right, from the run repeated")
    ] = False,
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
    debug: options.DebugOption = False,
) -> None:
    """Check a table of t, r, v, lambda, R against the laws of the model, without the functions of the solver.

    Exit 1 where a check fails, 3 where the new run stops before its end.
    """
    has_rows = any(run_settings.get(name) is not None for name in ("duration", "samples", "output_step"))
    asked = AuditOptions(run, events, plot, digits, as_json, quiet, verbose, has_rows)
    asked.require(model)
    read = model_reading.read(model, changes, as_json)
    model_reading.reported(lambda: carry_out(read, run_settings, asked), as_json)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class AuditOptions:
    """Options of `audit` besides the settings of the run; `has_rows`: those that say where its rows are are given."""

    table: str | None
    events: str | None
    plot: str | None
    digits: bool
    as_json: bool
    quiet: bool
    verbose: bool
    has_rows: bool

    def require(self, model: str) -> None:
        """Refuse what cannot be done with this MODEL."""
        file_requests.require_endings((self.plot, formats.FIGURES), (self.table, formats.TABLES))
        if self.table is not None and not os.path.exists(self.table):
            raise exits.UsageError(f"--run: there is no file {self.table}")
        if self.events is not None:
            file_requests.require_endings((self.events, formats.TABLES))
            if self.table is None:
                raise exits.UsageError("--events: the incidents are of the table of --run, which is missing")
            if not os.path.exists(self.events):
                raise exits.UsageError(f"--events: there is no file {self.events}")
        if self.plot is not None:
            read = [("MODEL", model), ("--run", self.table), ("--events", self.events)]
            file_requests.require(read, ("--plot", self.plot, formats.FIGURES))
        if self.table is not None and self.has_rows:
            raise exits.UsageError(
                "--run: the table has its own rows; --duration, --samples and --output-step are of a new run"
            )


def carry_out(model: Model, given: RunSettings, options: AuditOptions) -> None:
    """Audit and print the report. Raises `exits.Exit` with 1 where a check fails, with 3 where the run stopped before
    its end."""
    found = _audited(model, given, options)
    if options.plot is not None:
        with write_guard.drawing(options.plot):
            from lagcli.output.figures import audit_figure, figure_page

            figure_page.write(options.plot, audit_figure.compose(found, model.units.time))
    if options.as_json:
        print(json_text.text(found.as_json()))
    else:
        _print_report(found, options)
    if not options.quiet:
        exits.print_err_all(f"note: {note}" for note in found.notes)
    if not found.passed:
        raise exits.Exit(exits.INVALID)
    if not found.complete:
        raise exits.Exit(exits.STOPPED)


def _audited(model: Model, given: RunSettings, options: AuditOptions) -> Audit:
    """The audit. Raises `exits.UsageError` for a table that is none, or not of this model, `exits.Exit` with 3 where
    the run stopped before its first row."""
    from lagcli.api import audit as auditing
    from lagcli.auditing.evidence.table_input import TableError
    from lagcli.output.tables import read_table
    from lagcli.running.trajectory import SimulationStopped

    try:
        return auditing.audit(model, options.table, digits=options.digits, events=_events(options), **given)
    except OSError as error:
        raise exits.UsageError(f"--run: cannot read {options.table}: {error.strerror}") from None
    except read_table.UNREADABLE as error:
        raise exits.UsageError(f"--run: {error}") from None
    except SimulationStopped as stopped:
        exits.print_err(f"lagcli: {stopped.reason}; there is no row to audit")
        raise exits.Exit(exits.STOPPED) from None
    except TableError as error:
        raise exits.UsageError(f"--run {options.table}: {error}") from None
    except ValueError as error:
        raise exits.UsageError(str(error)) from None


def _events(options: AuditOptions) -> IncidentTable | None:
    """The incidents in the file of `--events`. Raises `exits.UsageError` for one that is none."""
    from lagcli.output.tables import incident_table, read_table

    if options.events is None:
        return None
    try:
        return incident_table.read(options.events)
    except OSError as error:
        raise exits.UsageError(f"--events: cannot read {options.events}: {error.strerror}") from None
    except read_table.UNREADABLE as error:
        raise exits.UsageError(f"--events: {error}") from None


def _print_report(found: Audit, options: AuditOptions) -> None:
    """The report: a table of checks, what fails by name, and what the rows determine uniquely."""
    from lagcli.auditing import audit_lines
    from lagcli.output.figures import labels

    name, report = labels.shortened(found.title or found.path, labels.TITLE), audit_lines.of(found)
    console.paragraph(
        f"Audit of {name}: {found.rows} rows from t = {found.start:g} to {found.end:g},"
        f" run to rtol {found.rtol:g}, atol {found.atol:g}",
        "",
    )
    print(
        "\n"
        + "\n".join(
            diagnostics.printable(line) for line in _table_of(found.checks, report.rows, options.verbose)
        )
        + "\n"
    )
    for head, faults, others in report.failures:
        console.paragraph(head, "  ")
        for fault in faults:
            console.paragraph(f"  {fault}", "    ")
        if others:
            print(f"  and {others} others")
    for sentence in report.sentences:
        console.paragraph(sentence, "")


def _table_of(checks: tuple[Check, ...], lines: list[tuple[str, ...]], verbose: bool) -> list[str]:
    """The lines of the table; on a narrow terminal laws are named by their numbers alone."""
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    if sum(widths) + 2 * (len(widths) - 1) > console.width():
        lines = [
            (line[0], law, *line[2:])
            for line, law in zip(lines, ["law", *(c.law for c in checks)], strict=True)
        ]
        widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
        room = console.width() - sum(widths[:-1]) - 2 * (len(widths) - 1)
        widths[-1] = max(LEAST_WHERE, min(widths[-1], room))
    table_lines = []
    for number, line in enumerate(lines):
        last = textwrap.wrap(line[-1], widths[-1], break_on_hyphens=False) or [""]
        cells = [cell.ljust(width) for cell, width in zip(line[:-1], widths[:-1], strict=True)]
        table_lines.append("  ".join([*cells, last[0]]).rstrip())
        table_lines += [" " * (sum(widths[:-1]) + 2 * len(widths[:-1])) + part for part in last[1:]]
        if number and checks[number - 1].note and (verbose or checks[number - 1].name == "momenta"):
            for part in checks[number - 1].note.split("; "):
                table_lines += textwrap.wrap(
                    part, console.width(), initial_indent="    ", subsequent_indent="      "
                )
    return table_lines
