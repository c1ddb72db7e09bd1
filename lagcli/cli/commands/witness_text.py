"""`lagcli check --witness`: a loop that shows a row to be nonholonomic, printed, drawn, or refused with the reason."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from lagcli import progress
from lagcli.cli.terminal import console, exits
from lagcli.errors import diagnostics
from lagcli.output.files import write_guard

if TYPE_CHECKING:
    from lagcli.analysis.check_report import ConstraintReport, Report
    from lagcli.analysis.holonomy.witness import Path, Witness
    from lagcli.model.model import Model

PARTS_OF_PI = 12  # angles that are such parts of pi are written so
MOST_DIGITS = 12  # decimals of a number that is known to rounding


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
            for line in lines(self.found):
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


def shown(model: Model, report: Report, row: str, assemble: bool, limit: float, plot: str | None) -> Answer:
    """The answer within the limit, the loop of which is drawn into the file `plot`.

    Raises `exits.UsageError` where no differential row is meant.
    """
    verdict = _constraint(report, row).verdict
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


def _constraint(report: Report, row: str) -> ConstraintReport:
    rows = {c.name: c for c in report.constraints}
    differential = [name for name, c in rows.items() if c.verdict.declared == "differential"]
    if row in differential:
        return rows[row]
    if row in rows:
        kind = rows[row].verdict.declared
        raise exits.UsageError(f"--witness {row}: that row is {kind}; only differential rows have one")
    parts = [name for name in differential if name.startswith((f"{row}.", f"{row}["))]
    hint = f"its rows are `{parts[0]}` to `{parts[-1]}`" if parts else ""
    hint = hint or diagnostics.nearest(row, differential)
    hint = hint or ("`check` lists them" if differential else "the model has none")
    raise exits.UsageError(f"--witness {row}: there is no differential row `{row}`; {hint}")


def lines(found: Witness) -> list[str]:
    """The proof in words."""
    shown = found.names if found.is_timed else found.names[:-1]
    base = ", ".join(f"{n} = {number(z)}" for n, z in zip(shown, found.base, strict=False))
    lines = [f"`{found.row}` is nonholonomic: {_headline(found)}", f"from {base}"]
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
    lines.append(_amount_text(found))
    if found.follow:
        lines.append(f"constraints tie {', '.join(found.follow)} to {found.coordinate}")
    surface = f", |f| <= {found.surface_residual:.1e}" if found.surface_residual else ""
    lines.append(
        f"all rows hold along the way: |A dq| <= {found.row_residual:.1e} |A| |dq|{surface};"
        f" the others come back to {found.closure:.1e}"
    )
    lines.append("a function of the coordinates behind the row would have kept its value")
    return [diagnostics.printable(line) for line in lines]


def _headline(found: Witness) -> str:
    if found.is_timed:
        return (
            f"two paths over equal times end with the same {_list(found.back)} and another {found.coordinate}"
        )
    return f"a closed loop in {_list(found.back)} moves {found.coordinate} by {amount(found)}"


def _list(names: tuple[str, ...]) -> str:
    return ", ".join(names) if len(names) <= 6 else f"{', '.join(names[:5])} and {len(names) - 5} others"


def _amount_text(found: Witness) -> str:
    p = found.along(found.coordinate)
    ends = [path.corners[-1][p] for path in found.paths]
    uncertain = f"(+- {found.error:.1e})"
    if found.is_timed:
        return (
            f"at the end {found.coordinate} is {number(ends[0])} and {number(ends[1])}:"
            f" a difference of {amount(found)} {uncertain}"
        )
    return (
        f"{_list(found.back)} are back and {found.coordinate} has moved from {number(found.base[p])}"
        f" to {number(ends[0])}: by {amount(found)} {uncertain}"
    )


def _moves(found: Witness, path: Path) -> Iterator[str]:
    """Each segment: what is moved, then what follows."""
    for before, after in zip(path.corners, path.corners[1:], strict=False):
        free: list[str] = []
        led: list[str] = []
        for name, a, b in zip(found.names, before, after, strict=True):
            if abs(b - a) > 1e-12 * max(1.0, abs(a), abs(b)):
                text = f"{name} from {number(a)} to {number(b)}"
                (free if name in found.free or not found.is_drawn else led).append(text)
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
