"""`lagcli check`: the report of each model, and a loop that shows a row to be nonholonomic."""

from __future__ import annotations

import dataclasses
import math
import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from lagcli import progress
from lagcli.cli.commands import completing, options
from lagcli.cli.terminal import console, exits
from lagcli.errors import diagnostics
from lagcli.model import settings
from lagcli.output.files import formats, write_guard

if TYPE_CHECKING:
    from lagcli.analysis.check_report import ConstraintReport, Report
    from lagcli.analysis.holonomy.witness import Path, Witness
    from lagcli.model.model import Model

ALWAYS, FORMULAS = ("constraint", "declared", "verdict"), ("integral", "factor")
NARROW = 60  # columns of a terminal below which a table is folded beyond reading
PARTS_OF_PI = 12  # angles that are such parts of pi are written so
MOST_DIGITS = 12  # decimals of a number that is known to rounding
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

    asked = CheckOptions(strict, assemble, limit, witness, plot, as_json, quiet, verbose)
    options.require_models(models)
    if witness is None and plot is not None:
        raise exits.UsageError("--plot draws the loop of --witness NAME; give that too")
    if witness is not None:
        if len(models) > 1:
            raise exits.UsageError("--witness takes one MODEL")
        write_guard.require_outputs(models[0], None, plot, as_json=False)
    if watch:
        options.follow(models, lambda: carry_out(models, changes, asked), quiet)
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


def carry_out(models: list[str], changes: list[str] | None, asked: CheckOptions) -> None:
    """Report on all models. Raises `exits.Exit` with the worst of their codes, `exits.UsageError`."""
    from lagcli.api import check as checking

    answers: list[dict[str, object]] = []
    codes: list[int] = []
    for path in models:
        began = time.perf_counter()
        try:
            read = options.load(path, changes)
            report = checking.check(read, assemble=asked.assemble, limit=asked.limit)
            shown = (
                witness_answer(read, report, asked.witness, asked.assemble, asked.limit, asked.plot)
                if asked.witness is not None
                else None
            )
        except diagnostics.ModelError as error:
            codes.append(exits.of(error))
            if asked.as_json:
                answers.append({**({"path": path} if len(models) > 1 else {}), **options.errors(error)})
            else:
                exits.print_err(str(error))
            continue
        # Several objects in a list say which model each is of.
        heading = {"path": report.path, "title": report.title} if len(models) > 1 else {}
        witnessed = {} if shown is None else {"witness": shown.as_json()}
        if asked.as_json:
            answers.append({**heading, **report.as_json(), **witnessed})
        warned = any(found.severity == "warning" for found in report.warnings)
        codes.append(exits.INVALID if asked.strict and warned else exits.DONE)
        if not asked.as_json:
            print_report(report, heading=len(models) > 1)
            lines = report.initial.assembled.lines(read.units) if report.initial.assembled else ()
            exits.print_err_all(
                () if asked.quiet else (*lines, *(warning.render() for warning in report.warnings))
            )
        if shown is not None:
            codes.append(shown.print_report(asked.as_json))
        if asked.verbose:
            exits.print_err(f"{report.path}: checked in {time.perf_counter() - began:.3f} s")
    if asked.as_json:
        print(formats.json_line(answers[0] if len(answers) == 1 else answers))
    raise exits.Exit(max(codes))


def print_report(found: Report, heading: bool) -> None:
    """The report of `check` on stdout; `heading`: it is one of several."""
    from lagcli.analysis import check_report
    from lagcli.output.figures import labels

    title = labels.shortened(found.title or found.path, labels.TITLE)
    console.paragraph(f"{found.path}: {title}" if heading and found.title else title, "")
    print()
    if found.constraints:
        _constraints(found.constraints, [check_report.cells(one) for one in found.constraints])
        print()
    for part in check_report.parts(found):
        for line in part:
            console.paragraph(line, "    ")
        if part:
            print()
    console.paragraph(check_report.start(found), "    ")
    if heading:
        print()
    # A long list of models is read as it comes.
    sys.stdout.flush()


def _constraints(constraints: tuple[ConstraintReport, ...], rows: list[dict[str, str]]) -> None:
    """The table, and below it what needs a whole line: reasons, and formulas too long for the terminal."""
    shown = [name for name in rows[0] if name in ALWAYS or any(row[name] for row in rows)]
    narrow = console.width() < NARROW
    formulas = narrow or not console.fits(shown, [[row[name] for name in shown] for row in rows])
    if narrow:
        for row in rows:
            redundant = ", redundant" if row["redundant"] else ""
            multiplier = f", multiplier {row['multiplier']}" if row["multiplier"] else ""
            side = f", {row['at the start']} at the start" if row["at the start"] else ""
            console.paragraph(f"{row['constraint']}: {row['verdict']}{redundant}{multiplier}{side}", "    ")
    else:
        shown = [name for name in shown if not (formulas and name in FORMULAS)]
        console.table(shown, [[row[name] for name in shown] for row in rows], COLOURS)
    below = []
    for row, constraint in zip(rows, constraints, strict=True):
        verdict = constraint.verdict
        below += [f"{verdict.row}: {name} {row[name]}" for name in FORMULAS if formulas and row[name]]
        # A row that is what it was declared to be needs no reason.
        below += [f"{verdict.row}: {verdict.method}"] if verdict.declared != verdict.kind else []
    if below:
        print()
    for line in below:
        console.paragraph(line, "    ")


@dataclasses.dataclass(frozen=True, slots=True)
class Answer:
    """A witness, or the reason why there is none, with its exit code."""

    found: Witness | None
    reason: str
    code: int

    def print_report(self, as_json: bool) -> int:
        """Say it, the loop on stdout and a reason on stderr; the exit code."""
        if self.found is None:
            exits.print_err(f"lagcli: {self.reason}")
        elif not as_json:
            print()
            for line in _witness_lines(self.found):
                console.paragraph(line, "    ")
        return self.code

    def as_json(self) -> dict[str, object] | None:
        """The object `witness` of `check --json`."""
        found = self.found
        if found is None:
            return None
        names = list(found.names if found.is_timed else found.names[:-1])
        paths = [
            {"coordinates": names, "points": path.points[:, : len(names)].tolist()} for path in found.paths
        ]
        return {
            "row": found.row,
            "coordinate": found.coordinate,
            "amount": found.amount,
            "error": found.error,
            **({"paths": paths} if found.is_timed else {"loop": paths[0]}),
            "back": list(found.back),
            "follow": list(found.follow),
            "row_residual": found.row_residual,
            "surface_residual": found.surface_residual,
            "closure": found.closure,
        }


def witness_answer(
    model: Model, report: Report, row: str, assemble: bool, limit: float, plot: str | None
) -> Answer:
    """The answer within the limit, the loop of which is drawn into the file `plot`.

    Raises `exits.UsageError` where no differential row is meant.
    """
    rows = {c.name: c for c in report.constraints}
    differential = [name for name, c in rows.items() if c.verdict.declared == "differential"]
    if row not in differential:
        if row in rows:
            kind = rows[row].verdict.declared
            raise exits.UsageError(f"--witness {row}: that row is {kind}; only differential rows have one")
        parts = [name for name in differential if name.startswith((f"{row}.", f"{row}["))]
        hint = f"its rows are `{parts[0]}` to `{parts[-1]}`" if parts else ""
        hint = hint or diagnostics.nearest(row, differential)
        hint = hint or ("`check` lists them" if differential else "the model has none")
        raise exits.UsageError(f"--witness {row}: there is no differential row `{row}`; {hint}")
    verdict = rows[row].verdict
    if verdict.kind == "undecided":
        reason = f"undecided: whether `{row}` is integrable: {verdict.method}"
        return Answer(None, reason, exits.UNDECIDED)
    if verdict.kind != "nonholonomic":
        integral = "" if verdict.integral is None else f": {verdict.integral} = const"
        together = " together with other rows" if verdict.kind == "jointly-integrable" else ""
        reason = f"`{row}` is integrable{together}{integral}, so that no loop shows the contrary"
        return Answer(None, reason, exits.INVALID)
    from lagcli.api import check as checking

    found = checking.witness(model, row, assemble=assemble, limit=limit)
    if found is None:
        reason = (
            f"undecided: no loop that shows `{row}` to be nonholonomic was found in {progress.told(limit)}"
        )
        return Answer(None, reason, exits.UNDECIDED)
    if plot is not None:
        with write_guard.drawing(plot):
            from lagcli.output.figures import figure_page
            from lagcli.reporting import loop_figure

            figure_page.write(plot, loop_figure.compose(found))
    return Answer(found, "", exits.DONE)


def _witness_lines(found: Witness) -> list[str]:
    """The proof in words."""
    moving, back, many = found.coordinate, ", ".join(found.back), len(found.back)
    if many > 6:
        back = f"{', '.join(found.back[:5])} and {many - 5} others"
    by = amount(found)
    headline = f"a closed loop in {back} moves {moving} by {by}"
    if found.is_timed:
        headline = f"two paths over equal times end with the same {back} and another {moving}"
    shown = found.names if found.is_timed else found.names[:-1]
    base = ", ".join(f"{n} = {number(z)}" for n, z in zip(shown, found.base, strict=False))
    lines = [f"`{found.row}` is nonholonomic: {headline}", f"from {base}"]
    if found.holds_time:
        lines.append(f"with t held at {number(found.base[-1])}")
    if found.is_bent:
        lines.append(
            "(in another configuration of the whole system: at the declared start no loop was found)"
        )
    elif found.is_shifted:
        lines.append("(beside the declared start, where no loop was found)")
    for label, path in zip("ab" if found.is_timed else " ", found.paths, strict=True):
        lines += [f"  {label.strip()}{k}. {move}" for k, move in enumerate(_moves(found, path), 1)]
    p = found.along(moving)
    ends = [path.corners[-1][p] for path in found.paths]
    if found.is_timed:
        ending = f"at the end {moving} is {number(ends[0])} and {number(ends[1])}: a difference of {by}"
    else:
        ending = f"{back} are back and {moving} has moved from {number(found.base[p])} to {number(ends[0])}: by {by}"
    lines.append(f"{ending} (+- {found.error:.1e})")
    if found.follow:
        lines.append(f"constraints tie {', '.join(found.follow)} to {moving}")
    surface = f", |f| <= {found.surface_residual:.1e}" if found.surface_residual else ""
    lines.append(
        f"all rows hold along the way: |A dq| <= {found.row_residual:.1e} |A| |dq|{surface};"
        f" the others come back to {found.closure:.1e}"
    )
    lines.append("a function of the coordinates behind the row would have kept its value")
    return [diagnostics.printable(line) for line in lines]


def _moves(found: Witness, path: Path) -> Iterator[str]:
    """Each segment: what is moved, then what follows."""
    for before, after in zip(path.corners, path.corners[1:], strict=False):
        free: list[str] = []
        led: list[str] = []
        for name, a, b in zip(found.names, before, after, strict=True):
            if abs(b - a) > 1e-12 * max(1.0, abs(a), abs(b)):
                text = f"{name} from {number(a)} to {number(b)}"
                (free if name in found.free or not found.free else led).append(text)
        follows = f"; so {', '.join(led)}" if led else ""
        yield (", ".join(free) or "nothing moves") + follows


def number(value: float) -> str:
    """A short text for a length or an angle: 0.5, pi/4."""
    value = float(value)
    twelfths = value / math.pi * PARTS_OF_PI
    if abs(value) > 1e-9 and abs(twelfths - round(twelfths)) < 1e-9:
        rounded = round(twelfths)
        common = math.gcd(rounded, PARTS_OF_PI)
        above, below = rounded // common, PARTS_OF_PI // common
        sign = "-" if above < 0 else ""
        return sign + ("pi" if abs(above) == 1 else f"{abs(above)}*pi") + (f"/{below}" if below > 1 else "")
    return f"{round(value, 10) + 0.0:.10g}"


def amount(found: Witness) -> str:
    """The amount with the digits that are certain."""
    decimals = min(MOST_DIGITS, math.floor(-math.log10(2 * found.error)))
    return f"{round(found.amount, decimals) + 0.0:.15g}"
