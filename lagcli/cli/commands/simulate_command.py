"""`lagcli simulate`: a run into files, and what is printed of it."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

from lagcli.cli.commands import completing, options
from lagcli.cli.terminal import console, exits
from lagcli.model import settings
from lagcli.model.settings import RunSettings
from lagcli.output.files import formats

if TYPE_CHECKING:
    from lagcli.running.run_request import RunRequest
    from lagcli.running.written_run import RunEnding, WrittenRun


@options.command()
def simulate(
    model: options.ModelArgument,
    output: Annotated[str | None, options.output(f"{formats.LISTED}; - for stdout")] = None,
    plot: Annotated[str | None, options.file("figure of lambda and R: png, svg, pdf")] = None,
    *,
    run_settings: RunSettings,
    columns: Annotated[
        str | None,
        options.named("PATTERNS", "columns to write, such as 't,lambda.*,R.a.*'", completing.columns),
    ] = None,
    events: Annotated[
        str | None, options.file("table of impacts, contacts, releases and events; - for stdout")
    ] = None,
    event_rows: Annotated[bool, "two more rows at each of these instants, before and after"] = False,
    stats: Annotated[str | None, options.file("the account of the run as JSON")] = None,
    checkpoint: Annotated[str | None, options.file("keep the state of the run, for --resume")] = None,
    resume: Annotated[str | None, options.file("go on from a checkpoint of the same run")] = None,
    begin: options.FromOption = None,
    digits: Annotated[bool, "columns err.*: the error of r, v, lambda and R, from a second run"] = False,
    limit: options.LimitOption = settings.LIMIT,
    changes: options.SetOption = None,
    as_json: Annotated[bool, "errors, and the account if stdout is free, as JSON on stdout"] = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
) -> None:
    """Integrate m a = F + sum lambda_i B_i and write t, r, v, lambda, R, energy as a table.

    CSV on standard output without -o and --plot. Exit 3 where the integration stops before its end: the rows
    so far are in FILE.partial, and FILE is as it was.
    """
    from lagcli.api import simulate
    from lagcli.running import run_request

    asked = run_request.RunRequest(
        output, plot, stats, columns, as_json, quiet, verbose,
        checkpoint, resume, limit, digits, events, event_rows,
    )  # fmt: skip
    asked.require(model)
    read = options.read(model, changes, as_json)
    with options.json_errors(as_json):
        written = simulate.to_files(read, run_settings, asked, begin)
    carry_out(written, asked)


def carry_out(written: WrittenRun, request: RunRequest) -> None:
    """Integrate, write files and print messages. Raises `exits.Exit` with 3 where the run stopped before its end."""
    exits.print_err_all(written.messages)
    # Rows and a bar on one terminal would overwrite each other.
    is_silent = request.quiet or (written.is_stdout_taken and sys.stdout.isatty())
    with console.progress(written.start, written.end, is_silent) as bar:
        for step in written.steps():
            if isinstance(step, float):
                bar.at(step)
                continue
            bar.close()
            if isinstance(step, str):
                exits.print_err(step)
                continue
            exits.print_err_all(warning.text for warning in step.stats.warnings)
            exits.print_notes(step.notes, request.quiet)
            if not request.quiet:
                _print_account(step)
            if step.reason:
                exits.print_err(f"lagcli: {step.reason}")
                raise exits.Exit(exits.STOPPED)


def _print_account(end: RunEnding) -> None:
    stats, head = end.stats, "stopped" if end.reason else "done"
    balance = "not known: the power of rows or forces oscillates too often within a step"
    if stats.energy_imbalance is not None:
        balance = f"to {stats.energy_imbalance:.1e} of the energy exchanged"
    exits.print_err(
        f"{head}: {stats.steps} steps ({stats.rejected} rejected) of {stats.method} in {stats.solve_seconds:.3g} s,"
        f" {end.tolerance_text};"
        f" drift {stats.position_drift:.1e} in position, {stats.velocity_drift:.1e} in velocity;"
        f" energy balance {balance}"
    )
    # The incidents that are counted, and the event that ended the run, or nothing
    counted = (
        (stats.impacts, "impact", "impacts"),
        (stats.accumulations, "accumulation of impacts", "accumulations of impacts"),
        (stats.releases, "release", "releases"),
    )
    parts = [f"{count} {one if count == 1 else several}" for count, one, several in counted if count]
    if stats.largest_penetration > 0:
        parts.append(f"largest penetration {stats.largest_penetration:.1e}")
    if stats.ended_by is not None and stats.t_end is not None:
        parts.append(f"ended by the event {stats.ended_by} at t = {stats.t_end:.9g}")
    if happened := ", ".join(parts):
        exits.print_err(f"incidents: {happened}")
    if end.digits:
        exits.print_err(f"digits: {end.digits}")
