"""`lagcli simulate`: a run into files, and what is printed of it."""

from __future__ import annotations

import sys

from lagcli.cli.terminal import console, exits
from lagcli.output.run_account import Stats
from lagcli.output.runs.run_request import RunRequest
from lagcli.output.runs.written_run import RunEnding, WrittenRun


def run(written: WrittenRun, request: RunRequest) -> None:
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
            else:
                _print_end(step, request.quiet)


def _print_end(end: RunEnding, quiet: bool) -> None:
    if not quiet:
        exits.print_err_all(f"note: {note}" for note in end.notes)
        _print_account(end)
    if end.reason:
        exits.print_err(f"lagcli: {end.reason}")
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
    if happened := _incidents(stats):
        exits.print_err(f"incidents: {happened}")
    if end.digits:
        exits.print_err(f"digits: {end.digits}")


def _incidents(stats: Stats) -> str:
    """The incidents that are counted, and the event that ended the run, or nothing."""
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
    return ", ".join(parts)
