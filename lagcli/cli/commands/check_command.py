"""`lagcli check`: the report of each model, and a loop that shows a row to be nonholonomic."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

from lagcli import progress
from lagcli.cli.commands import completing, options
from lagcli.cli.terminal import console, exits
from lagcli.errors import diagnostics
from lagcli.model import settings
from lagcli.output.files import formats, write_guard

if TYPE_CHECKING:
    from lagcli.analysis.check_report import Report
    from lagcli.analysis.holonomy.witness import Witness
    from lagcli.model.model import Model

ALWAYS, FORMULAS = ("constraint", "declared", "verdict"), ("integral", "factor")
NARROW = 60  # columns of a terminal below which a table is folded beyond reading
PARTS_OF_PI = 12  # angles that are such parts of pi are written so
MOST_DIGITS = 12  # decimals of a number that is known to rounding
COLOURS = {"nonholonomic": "yellow", "undecided": "red", "yes": "red", "violated": "red"}


@options.command()
def check(
    models: Annotated[
        list[str], options.argument("MODEL...", "model files; - for standard input", completing.model_files)
    ],
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    strict: Annotated[bool, "exit 1 on warnings"] = False,
    assemble: options.AssembleOption = False,
    limit: options.LimitOption = settings.LIMIT,
    witness: Annotated[
        str | None,
        options.named("NAME", "a loop that shows a row to be nonholonomic", completing.differential),
    ] = None,
    plot: Annotated[str | None, options.file("figure of that loop: png, svg, pdf")] = None,
    watch: options.WatchOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
) -> None:
    """Classify the constraints, count the degrees of freedom, check the initial values.

    With --json one object for one MODEL; for several a list in the order of the MODELs, each with path and title.
    """
    options.require_models(models)
    if witness is None and plot is not None:
        raise exits.UsageError("--plot draws the loop of --witness NAME; give that too")
    if witness is not None and len(models) > 1:
        raise exits.UsageError("--witness takes one MODEL")
    write_guard.require_outputs(models[0], None, plot, as_json=False)

    def report_all() -> None:
        """Report on all models. Raises `exits.Exit` with the worst of their codes, `exits.UsageError`."""
        from lagcli.api import check as checking

        answers: list[dict[str, object]] = []
        codes: list[int] = []
        for path in models:
            began = time.perf_counter()
            loop: Witness | None = None
            reason = ""
            try:
                read = options.load(path, changes)
                report = checking.check(read, assemble=assemble, limit=limit)
                if witness is not None:
                    loop, reason, code = _answer(read, report, witness, assemble, limit, plot)
                    codes.append(code)
            except diagnostics.ModelError as error:
                codes.append(exits.of(error))
                if as_json:
                    answers.append({**({"path": path} if len(models) > 1 else {}), **options.errors(error)})
                else:
                    exits.print_err(str(error))
                continue
            warned = any(found.severity == "warning" for found in report.warnings)
            codes.append(exits.INVALID if strict and warned else exits.DONE)
            if as_json:
                # Several objects in a list say which model each is of.
                heading = {"path": report.path, "title": report.title} if len(models) > 1 else {}
                witnessed = {} if witness is None else {"witness": _as_json(loop)}
                answers.append({**heading, **report.as_json(), **witnessed})
            else:
                print_report(report, heading=len(models) > 1)
                lines = report.initial.assembled.lines(read.units) if report.initial.assembled else ()
                warnings = (warning.render() for warning in report.warnings)
                exits.print_err_all(() if quiet else (*lines, *warnings))
            if reason:
                exits.print_err(f"lagcli: {reason}")
            elif loop is not None and not as_json:
                print()
                for line in _proof(loop):
                    console.paragraph(diagnostics.printable(line))
            if verbose:
                exits.print_err(f"{report.path}: checked in {time.perf_counter() - began:.3f} s")
        if as_json:
            print(formats.json_line(answers[0] if len(answers) == 1 else answers))
        raise exits.Exit(max(codes))

    if watch:
        options.follow(models, report_all, quiet)
    report_all()


def print_report(found: Report, heading: bool) -> None:
    """The report of `check` on stdout; `heading`: it is one of several."""
    from lagcli.analysis import check_report
    from lagcli.output.figures import labels

    title = labels.shortened(found.title or found.path, labels.TITLE)
    console.paragraph(f"{found.path}: {title}" if heading and found.title else title, "")
    print()
    if found.constraints:
        # The table, and below it what needs a whole line: reasons, and formulas too long for the terminal
        rows = [check_report.cells(one) for one in found.constraints]
        shown = [name for name in rows[0] if name in ALWAYS or any(row[name] for row in rows)]
        is_narrow = console.width() < NARROW
        are_below = is_narrow or not console.fits(shown, [[row[name] for name in shown] for row in rows])
        if is_narrow:
            for row in rows:
                redundant = ", redundant" if row["redundant"] else ""
                multiplier = f", multiplier {row['multiplier']}" if row["multiplier"] else ""
                side = f", {row['at the start']} at the start" if row["at the start"] else ""
                console.paragraph(f"{row['constraint']}: {row['verdict']}{redundant}{multiplier}{side}")
        else:
            shown = [name for name in shown if not (are_below and name in FORMULAS)]
            console.table(shown, [[row[name] for name in shown] for row in rows], COLOURS)
        below = []
        for row, constraint in zip(rows, found.constraints, strict=True):
            verdict = constraint.verdict
            below += [f"{verdict.row}: {name} {row[name]}" for name in FORMULAS if are_below and row[name]]
            # A row that is what it was declared to be needs no reason.
            below += [f"{verdict.row}: {verdict.method}"] if verdict.declared != verdict.kind else []
        if below:
            print()
        for line in below:
            console.paragraph(line)
        print()
    for part in check_report.parts(found):
        for line in part:
            console.paragraph(line)
        if part:
            print()
    console.paragraph(check_report.start(found))
    if heading:
        print()
    # A long list of models is read as it comes.
    sys.stdout.flush()


def _answer(
    model: Model, report: Report, row: str, assemble: bool, limit: float, plot: str | None
) -> tuple[Witness | None, str, int]:
    """A loop that shows a row to be nonholonomic, drawn into the file `plot`, or the reason why there is none, and the
    exit code. Raises `exits.UsageError` where no differential row is meant."""
    rows = {c.name: c.verdict for c in report.constraints}
    differential = [name for name, verdict in rows.items() if verdict.declared == "differential"]
    if row not in differential:
        if row in rows:
            kind = rows[row].declared
            raise exits.UsageError(f"--witness {row}: that row is {kind}; only differential rows have one")
        parts = [name for name in differential if name.startswith((f"{row}.", f"{row}["))]
        hint = f"its rows are `{parts[0]}` to `{parts[-1]}`" if parts else ""
        hint = hint or diagnostics.nearest(row, differential)
        hint = hint or ("`check` lists them" if differential else "the model has none")
        raise exits.UsageError(f"--witness {row}: there is no differential row `{row}`; {hint}")
    verdict = rows[row]
    if verdict.kind == "undecided":
        return None, f"undecided: whether `{row}` is integrable: {verdict.method}", exits.UNDECIDED
    if verdict.kind != "nonholonomic":
        integral = "" if verdict.integral is None else f": {verdict.integral} = const"
        together = " together with other rows" if verdict.kind == "jointly-integrable" else ""
        reason = f"`{row}` is integrable{together}{integral}, so that no loop shows the contrary"
        return None, reason, exits.INVALID
    from lagcli.api import check as checking

    found = checking.witness(model, row, assemble=assemble, limit=limit)
    if found is None:
        within = progress.told(limit)
        reason = f"undecided: no loop that shows `{row}` to be nonholonomic was found in {within}"
        return None, reason, exits.UNDECIDED
    if plot is not None:
        with write_guard.drawing(plot):
            from lagcli.output.figures import figure_page
            from lagcli.reporting import loop_figure

            figure_page.write(plot, loop_figure.compose(found))
    return found, "", exits.DONE


def _as_json(found: Witness | None) -> dict[str, object] | None:
    """The object `witness` of `check --json`."""
    if found is None:
        return None
    names = list(found.names if found.is_timed else found.names[:-1])
    paths = [{"coordinates": names, "points": path.points[:, : len(names)].tolist()} for path in found.paths]
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


def _proof(found: Witness) -> Iterator[str]:
    """The proof in words."""
    moving, back, many = found.coordinate, ", ".join(found.back), len(found.back)
    if many > 6:
        back = f"{', '.join(found.back[:5])} and {many - 5} others"
    # The digits that are certain
    decimals = min(MOST_DIGITS, math.floor(-math.log10(2 * found.error)))
    by = f"{round(found.amount, decimals) + 0.0:.15g}"
    headline = f"a closed loop in {back} moves {moving} by {by}"
    if found.is_timed:
        headline = f"two paths over equal times end with the same {back} and another {moving}"
    yield f"`{found.row}` is nonholonomic: {headline}"
    shown = found.names if found.is_timed else found.names[:-1]
    yield f"from {', '.join(f'{n} = {number(z)}' for n, z in zip(shown, found.base, strict=False))}"
    if found.holds_time:
        yield f"with t held at {number(found.base[-1])}"
    if found.is_bent:
        yield "(in another configuration of the whole system: at the declared start no loop was found)"
    elif found.is_shifted:
        yield "(beside the declared start, where no loop was found)"
    # Each segment: what is moved, then what follows
    for label, path in zip(("a", "b") if found.is_timed else ("",), found.paths, strict=True):
        for k, (before, after) in enumerate(zip(path.corners, path.corners[1:], strict=False), 1):
            free: list[str] = []
            led: list[str] = []
            for name, a, b in zip(found.names, before, after, strict=True):
                if abs(b - a) > 1e-12 * max(1.0, abs(a), abs(b)):
                    text = f"{name} from {number(a)} to {number(b)}"
                    (free if name in found.free or not found.free else led).append(text)
            follows = f"; so {', '.join(led)}" if led else ""
            yield f"  {label}{k}. {', '.join(free) or 'nothing moves'}{follows}"
    p = found.along(moving)
    ends = [path.corners[-1][p] for path in found.paths]
    if found.is_timed:
        ending = f"at the end {moving} is {number(ends[0])} and {number(ends[1])}: a difference of {by}"
    else:
        ending = f"{back} are back and {moving} has moved from {number(found.base[p])} to {number(ends[0])}: by {by}"
    yield f"{ending} (+- {found.error:.1e})"
    if found.follow:
        yield f"constraints tie {', '.join(found.follow)} to {moving}"
    surface = f", |f| <= {found.surface_residual:.1e}" if found.surface_residual else ""
    yield (
        f"all rows hold along the way: |A dq| <= {found.row_residual:.1e} |A| |dq|{surface};"
        f" the others come back to {found.closure:.1e}"
    )
    yield "a function of the coordinates behind the row would have kept its value"


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
