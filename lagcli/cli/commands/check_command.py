"""`lagcli check`: the report of each model, and a loop that shows a row to be nonholonomic."""

from __future__ import annotations

import dataclasses
import sys
import time
from typing import TYPE_CHECKING, Annotated

import typer

from lagcli.cli.commands import completing, model_reading, options, witness_text
from lagcli.cli.terminal import console, exits
from lagcli.errors import diagnostics
from lagcli.model import settings
from lagcli.output.files import formats, write_guard

if TYPE_CHECKING:
    from lagcli.analysis.check_report import ConstraintReport, Report


ALWAYS, FORMULAS = ("constraint", "declared", "verdict"), ("integral", "factor")
NARROW = 60  # columns of a terminal below which a table is folded beyond reading
COLOURS = {"nonholonomic": "yellow", "undecided": "red", "yes": "red", "violated": "red"}


@exits.command
def check(
    models: Annotated[
        list[str],
        typer.Argument(
            metavar="MODEL...",
            help="model files; - for standard input",
            autocompletion=completing.model_files,
        ),
    ],
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    strict: Annotated[bool, typer.Option("--strict", help="exit 1 on warnings")] = False,
    assemble: options.AssembleOption = False,
    limit: options.LimitOption = settings.LIMIT,
    witness: Annotated[
        str | None,
        typer.Option(
            "--witness",
            metavar="NAME",
            help="a loop that shows a row to be nonholonomic",
            autocompletion=completing.differential,
        ),
    ] = None,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="figure of that loop: png, svg, pdf")
    ] = None,
    watch: options.WatchOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
    debug: options.DebugOption = False,
) -> None:
    """Classify the constraints, count the degrees of freedom, check the initial values.

    With --json one object for one MODEL; for several a list in the order of the MODELs, each with path and title.
    """
    from lagcli.cli.terminal import watching

    asked = CheckOptions(strict, assemble, limit, witness, plot, as_json, quiet, verbose)
    asked.require(models)
    if watch:
        watching.follow(models, lambda: carry_out(models, changes, asked), quiet)
    carry_out(models, changes, asked)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class CheckOptions:
    """Options of `check`; `witness`: the row whose loop is asked for, `plot`: the file of its figure."""

    strict: bool
    assemble: bool
    limit: float
    witness: str | None
    plot: str | None
    as_json: bool
    quiet: bool
    verbose: bool

    def require(self, models: list[str]) -> None:
        """Refuse what cannot be done for these MODELs."""
        model_reading.require_models(models)
        if self.witness is None:
            if self.plot is not None:
                raise exits.UsageError("--plot draws the loop of --witness NAME; give that too")
            return
        if len(models) > 1:
            raise exits.UsageError("--witness takes one MODEL")
        write_guard.require_outputs(models[0], None, self.plot, as_json=False)


def carry_out(models: list[str], changes: list[str] | None, options: CheckOptions) -> None:
    """Report on all models. Raises `exits.Exit` with the worst of their codes, `exits.UsageError`."""
    from lagcli.api import check as checking

    answers: list[dict[str, object]] = []
    codes: list[int] = []
    for path in models:
        began = time.perf_counter()
        try:
            read = model_reading.load(path, changes)
            report = checking.check(read, assemble=options.assemble, limit=options.limit)
            shown = (
                witness_text.shown(
                    read, report, options.witness, options.assemble, options.limit, options.plot
                )
                if options.witness is not None
                else None
            )
        except diagnostics.ModelError as error:
            codes.append(exits.of(error))
            if options.as_json:
                answers.append({**({"path": path} if len(models) > 1 else {}), **model_reading.errors(error)})
            else:
                exits.print_err(str(error))
            continue
        # Several objects in a list say which model each is of.
        heading = {"path": report.path, "title": report.title} if len(models) > 1 else {}
        witnessed = {} if shown is None else {"witness": shown.as_json()}
        if options.as_json:
            answers.append({**heading, **report.as_json(), **witnessed})
        warned = any(found.severity == "warning" for found in report.warnings)
        codes.append(exits.INVALID if options.strict and warned else exits.DONE)
        if not options.as_json:
            print_report(report, heading=len(models) > 1)
            lines = report.initial.assembled.lines(read.units) if report.initial.assembled else ()
            exits.print_err_all(
                () if options.quiet else (*lines, *(warning.render() for warning in report.warnings))
            )
        if shown is not None:
            codes.append(shown.print_report(options.as_json))
        if options.verbose:
            exits.print_err(f"{report.path}: checked in {time.perf_counter() - began:.3f} s")
    if options.as_json:
        print(formats.json_line(answers[0] if len(answers) == 1 else answers))
    raise exits.Exit(max(codes))


def print_report(found: Report, heading: bool) -> None:
    """The report of `check` on stdout; `heading`: it is one of several."""
    from lagcli.analysis import check_report
    from lagcli.output.figures import labels

    title = labels.shortened(found.title or found.path, labels.TITLE)
    console.paragraph(f"{found.path}: {title}" if heading and found.title else title, "")
    print()
    lines = check_report.lines(found)
    if found.constraints:
        _constraints(found.constraints, lines.cells)
        print()
    for part in (lines.shares, lines.joint, lines.counted):
        for line in part:
            console.paragraph(line, "    ")
        if part:
            print()
    console.paragraph(lines.start, "    ")
    if heading:
        print()
    # A long list of models is read as it comes.
    sys.stdout.flush()


def _constraints(constraints: tuple[ConstraintReport, ...], rows: list[dict[str, str]]) -> None:
    """The table, and below it what needs a whole line: reasons, and formulas too long for the terminal."""
    shown = [name for name in rows[0] if name in ALWAYS or any(row[name] for row in rows)]
    narrow = console.width() < NARROW
    formulas = narrow or not console.fits(shown, _picked(rows, shown))
    if narrow:
        for row in rows:
            redundant = ", redundant" if row["redundant"] else ""
            multiplier = f", multiplier {row['multiplier']}" if row["multiplier"] else ""
            side = f", {row['at the start']} at the start" if row["at the start"] else ""
            console.paragraph(f"{row['constraint']}: {row['verdict']}{redundant}{multiplier}{side}", "    ")
    else:
        shown = [name for name in shown if not (formulas and name in FORMULAS)]
        console.table(shown, _picked(rows, shown), COLOURS)
    below = []
    for row, constraint in zip(rows, constraints, strict=True):
        verdict = constraint.verdict
        below += [(verdict.row, f"{name} {row[name]}") for name in FORMULAS if formulas and row[name]]
        # A row that is what it was declared to be needs no reason.
        below += [(verdict.row, verdict.method)] if verdict.declared != verdict.kind else []
    if below:
        print()
    for name, sentence in below:
        console.paragraph(f"{name}: {sentence}", "    ")


def _picked(rows: list[dict[str, str]], shown: list[str]) -> list[list[str]]:
    return [[row[name] for name in shown] for row in rows]
