"""`lagcli audit`: a second opinion on a run, told, drawn, or as JSON."""

from __future__ import annotations

import dataclasses
import os
import pathlib
from typing import TYPE_CHECKING, Any

from lagcli import diagnostics, pipeline
from lagcli.auditing.record import TableError
from lagcli.cli import exits, machine
from lagcli.export import endings, read_table
from lagcli.export.tables import MissingExtra

if TYPE_CHECKING:
    from lagcli.auditing.report import Audit, Check, Place
    from lagcli.model import Model

SHOWN = 6  # names of a check that fails


@dataclasses.dataclass(frozen=True, slots=True)
class Wishes:
    """What the command line asks for besides the settings of the run."""

    table: str | None
    plot: str | None
    digits: bool
    as_json: bool
    quiet: bool
    verbose: bool

    def check(self) -> None:
        """Refuse what cannot be done before anything is computed. Raises `exits.UsageError`, `exits.WriteError`."""
        try:
            if self.plot is not None:
                endings.of(pathlib.Path(self.plot), endings.FIGURES)
                exits.check_writable(self.plot)
            if self.table is not None:
                endings.of(pathlib.Path(self.table), endings.TABLES)
        except endings.UnknownFormat as error:
            raise exits.UsageError(str(error)) from None
        if self.table is not None and not os.path.exists(self.table):
            raise exits.UsageError(f"--run: there is no file {self.table}")
        if self.table is not None and self.plot is not None and _same(self.table, self.plot):
            raise exits.UsageError(f"--plot {self.plot}: that is the file of --run")


def _same(one: str, other: str) -> bool:
    return os.path.realpath(one) == os.path.realpath(other)


def run(model: Model, given: dict[str, Any], wishes: Wishes) -> None:
    """Audit and tell. Raises `exits.Exit` with 1 where a check fails, with 3 where the run stopped before its end."""
    found = _audited(model, given, wishes)
    if wishes.plot is not None:
        from lagcli.export import audit_figure

        with exits.writing(wishes.plot):
            audit_figure.draw(pathlib.Path(wishes.plot), found, model.units.time)
    if wishes.as_json:
        print(machine.text(found.as_json()))
    else:
        print("\n".join(diagnostics.printable(line) for line in _lines(found, wishes)))
    if not wishes.quiet:
        exits.say_all(f"note: {note}" for note in found.notes)
        if found.unjudged:
            exits.say(
                f"note: not all could be judged of {', '.join(found.unjudged)}: rows stand too far apart there, or next"
                " to a singular configuration"
            )
    if not found.passed:
        raise exits.Exit(exits.INVALID)
    if not found.complete:
        raise exits.Exit(exits.STOPPED)


def _audited(model: Model, given: dict[str, Any], wishes: Wishes) -> Audit:
    """The audit. Raises `exits.UsageError` for a table that is none, or not of this model."""
    try:
        return pipeline.audit(model, wishes.table, wishes.digits, **given)
    except OSError as error:
        raise exits.UsageError(f"--run: cannot read {wishes.table}: {error.strerror}") from None
    except (endings.UnknownFormat, MissingExtra, read_table.UnreadableTable) as error:
        raise exits.UsageError(f"--run: {error}") from None
    except TableError as error:
        raise exits.UsageError(f"--run {wishes.table}: {error}") from None
    except ValueError as error:
        raise exits.UsageError(str(error)) from None


def _lines(found: Audit, wishes: Wishes) -> list[str]:
    """The report: a table of checks, what fails by name, and what the rows say about uniqueness."""
    name = found.title or found.path
    told = [
        f"Audit of {name}: {found.rows} rows from t = {found.start:g} to {found.end:g},"
        f" run to rtol {found.rtol:g}, atol {found.atol:g}",
        "",
        *_table_of(found.checks, wishes.verbose),
        "",
    ]
    for check in found.checks:
        if check.verdict == "fail":
            told.append(
                f"{check.name} fails ({check.law}: {check.equation}):"
                if check.law
                else f"{check.name} fails:"
            )
            told += [f"  {_fault(place)}" for place in check.failing[:SHOWN]]
            if check.failures > SHOWN:
                told.append(f"  and {check.failures - SHOWN} others")
    told += [sentence[0].upper() + sentence[1:] + "." for sentence in found.sentences]
    figures = dict(found.figures)
    if figures:
        told.append(
            f"Virtual work of R at most {figures['virtual_work']:.1e}; real work of R"
            f" {figures['work_of_constraints']:.10g}, energy gained {figures['energy_gained']:.10g}."
        )
    told.append(
        "No check fails." if found.passed else "A check fails: the table is not a motion of this model."
    )
    return told


def _fault(place: Place) -> str:
    return f"{place.name} at t = {place.t:.9g}: {place.value:.3g}, the limit is {place.limit:.3g}"


def _where(place: Place) -> str:
    """The place of an entry; one over a window names its times itself."""
    return place.name if " over t = " in place.name else f"{place.name}, t = {place.t:.6g}"


def _table_of(checks: tuple[Check, ...], verbose: bool) -> list[str]:
    head = ("check", "equation", "worst", "limit", "where", "verdict")
    lines = [head]
    for check in checks:
        law = f"{check.equation} ({check.law})" if check.law else check.equation
        worst = check.worst
        lines.append(
            (
                check.name,
                law,
                f"{worst.value:.1e}" if worst else "-",
                f"{worst.limit:.1e}" if worst else "-",
                _where(worst) if worst and worst.value else "-",
                check.verdict,
            )
        )
    widths = [max(len(line[k]) for line in lines) for k in range(len(head))]
    told = []
    for number, line in enumerate(lines):
        told.append("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip())
        if number and checks[number - 1].note and (verbose or checks[number - 1].name == "momenta"):
            told += [f"    {part}" for part in checks[number - 1].note.split("; ")]
    return told
