"""The text of `check` for a person, as wide as the terminal."""

from __future__ import annotations

import sys

from lagcli.analysis import check_lines
from lagcli.analysis.check_report import ConstraintReport, Report
from lagcli.cli.terminal import console
from lagcli.output.figures import labels

ALWAYS, FORMULAS = ("constraint", "declared", "verdict"), ("integral", "factor")
NARROW = 60  # columns of a terminal below which a table is folded beyond reading
COLOURS = {"nonholonomic": "yellow", "undecided": "red", "yes": "red", "violated": "red"}


def report(found: Report, heading: bool) -> None:
    """The report of `check` on stdout; `heading`: it is one of several."""
    title = labels.shortened(found.title or found.path, labels.TITLE)
    console.paragraph(f"{found.path}: {title}" if heading and found.title else title, "")
    print()
    lines = check_lines.of(found)
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
