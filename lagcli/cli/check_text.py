"""The text of `check` and `dof --explain` for a person."""

from __future__ import annotations

import sys

from lagcli.analysis.check_report import ConstraintReport, JointReport, Report
from lagcli.analysis.dof import DofCount
from lagcli.cli import console
from lagcli.errors import diagnostics
from lagcli.linear import independent_rows

NOT_UNIQUE = {True: "", False: "not unique", None: "undecided"}
ALWAYS, FORMULAS = ("constraint", "declared", "verdict"), ("integral", "factor")
MOST_NAMED = 40  # redundant rows
NARROW = 60  # columns of a terminal below which a table is folded beyond reading
COLOURS = {"nonholonomic": "yellow", "undecided": "red", "yes": "red", "violated": "red"}


def report(found: Report, heading: bool) -> None:
    """The report of `check` on stdout; `heading`: it is one of several."""
    title = found.title or found.path
    console.paragraph(f"{found.path}: {title}" if heading and found.title else title, "")
    print()
    if found.constraints:
        _constraints(found.constraints)
        print()
        if found.null_vectors:
            for line in independent_rows.shares([vector.rows for vector in found.null_vectors]):
                console.paragraph(diagnostics.printable(line), "    ")
            print()
        if any(one.verdict.declared == "differential" for one in found.constraints):
            for line in _joint(found.joint):
                console.paragraph(line, "    ")
            print()
    for line in count(found.dof):
        console.paragraph(line, "    ")
    print()
    console.paragraph(_start(found), "    ")
    if heading:
        print()
    # A long list of models is read as it comes.
    sys.stdout.flush()


def _constraints(constraints: tuple[ConstraintReport, ...]) -> None:
    """The table, and below it what needs a whole line: reasons, and formulas too long for the terminal."""
    rows = [_cells(constraint) for constraint in constraints]
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


def _joint(joint: JointReport) -> list[str]:
    """The verdict on all rows together: derived flag, growth vector, integrals."""
    lines = []
    if joint.derived_flag:
        dims = ", ".join(map(str, joint.derived_flag))
        lines.append(f"derived flag of all rows: [{dims}]")
        growth = ", ".join(map(str, joint.growth_vector))
        reach = "" if joint.is_bracket_generating else "not "
        time = " dimensions, time among them" if joint.counts_time else ""
        lines.append(f"growth vector: ({growth}) of {joint.dimension}{time}, {reach}bracket-generating")
    else:
        lines.append("derived flag of all rows: undecided")
    for one in joint.combinations:
        lines.append(f"first integral of {', '.join(one.rows)}: {one.text} = const")
    lines += [f"integrable, without a known integral: {form} = 0" for form in joint.unsolved]
    lines += joint.remarks
    return [diagnostics.printable(line) for line in lines]


def _picked(rows: list[dict[str, str]], shown: list[str]) -> list[list[str]]:
    return [[row[name] for name in shown] for row in rows]


def _cells(constraint: ConstraintReport) -> dict[str, str]:
    verdict = constraint.verdict
    return {
        "constraint": verdict.row,
        "declared": verdict.declared,
        "verdict": verdict.kind,
        "integral": "" if verdict.integral is None else f"{verdict.integral} = const",
        "factor": "" if verdict.integrating_factor in (None, "1") else str(verdict.integrating_factor),
        "redundant": "yes" if constraint.redundant else "",
        "multiplier": "" if constraint.side else NOT_UNIQUE[constraint.unique],
        "at the start": constraint.side or "",
    }


def count(found: DofCount) -> list[str]:
    """The count, line by line."""
    label = "3N" if found.coordinates == 3 * found.particles else "n"
    lines = [
        f"{_number(found.particles, 'particle')}, {_number(found.coordinates, 'coordinate')}"
        f" ({label} = {found.coordinates})"
    ]
    # A rank proves a count only where rows are independent or follow from one another: all counts are shown.
    if found.rank < found.rows:
        n = found.coordinates
        lines.append(
            f"{label} - rows = {n} - {found.rows} = {n - found.rows} by the number of the rows of f = 0"
        )
        lines.append(f"{label} - rank = {n} - {found.rank} = {n - found.rank} by the rank of their gradients")
    if found.configuration_dof is None:
        low, high = found.bounds
        return [*lines, f"degrees of freedom: undecided, between {low} and {high}: {found.reason}"]
    s, m = found.holonomic or 0, found.nonholonomic or 0
    lines.append(f"s = {_number(s, 'independent holonomic constraint')}")
    if found.redundant:
        names = ", ".join(found.redundant_rows[:MOST_NAMED])
        more = len(found.redundant_rows) - MOST_NAMED
        named = (f": {names}" if names else "") + (f" and {more} more" if more > 0 else "")
        lines.append(f"left out as redundant: {_number(found.redundant, 'row')}{named}")
    lines.append(f"degrees of freedom: {label} - s = {found.coordinates} - {s} = {found.configuration_dof}")
    if m:
        lines.append(f"m = {_number(m, 'independent nonholonomic constraint')}")
        total = f"{found.coordinates} - {s} - {m} = {found.velocity_dof}"
        lines.append(f"velocity degrees of freedom: {label} - s - m = {total}")
    lines += [f"note: {note}" for note in found.notes]
    lines.append(f"proof: {found.proof}")
    return [diagnostics.printable(line) for line in lines]


def _number(count: int, thing: str) -> str:
    return f"{count} {thing}" if count == 1 else f"{count} {thing}s"


def _start(found: Report) -> str:
    start = found.initial
    if start.consistent:
        return "initial values: consistent"
    told = (
        f"initial values: inconsistent, by {start.position_residual:.3g} in position and"
        f" {start.velocity_residual:.3g} in velocity (the largest residuals of the equations as they are written)"
    )
    return told if start.assembled is None else f"{told}; `assemble` moves the start"
