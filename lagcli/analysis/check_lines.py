"""The sentences of `check` and `dof --explain`: cells of the table of constraints, the joint verdict, the count, the
start."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from lagcli.errors import diagnostics

if TYPE_CHECKING:
    from lagcli.analysis.check_report import ConstraintReport, JointReport, Report
    from lagcli.analysis.dof import DofCount

NOT_UNIQUE = {True: "", False: "not unique", None: "undecided"}
MOST_NAMED = 40  # redundant rows


class ReportLines(NamedTuple):
    """The lines of a report: cells of the table of constraints by their headers, the rows that share forces, the joint
    verdict where there are differential rows, the count, the start."""

    cells: list[dict[str, str]]
    shares: list[str]
    joint: list[str]
    counted: list[str]
    start: str


def of(found: Report) -> ReportLines:
    """All lines of a report."""
    # A count alone has no rows that share forces.
    from lagcli.linear import independent_rows

    is_differential = any(one.verdict.declared == "differential" for one in found.constraints)
    return ReportLines(
        [cells(constraint) for constraint in found.constraints],
        [
            diagnostics.printable(line)
            for line in independent_rows.shares([vector.rows for vector in found.null_vectors])
        ],
        joint(found.joint) if is_differential else [],
        count(found.dof),
        start(found),
    )


def joint(joint: JointReport) -> list[str]:
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


def cells(constraint: ConstraintReport) -> dict[str, str]:
    """A row of the table of constraints, by its headers; empty where there is nothing to say."""
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
    if found.contacts:
        counted = _number(found.contacts, "one-sided constraint")
        lines.append(f"note: {counted} not counted; `displacements` tells what closed contacts leave free")
    lines.append(f"proof: {found.proof}")
    return [diagnostics.printable(line) for line in lines]


def _number(count: int, thing: str) -> str:
    return f"{count} {thing}" if count == 1 else f"{count} {thing}s"


def start(found: Report) -> str:
    """The sentence about the initial values."""
    initial = found.initial
    if initial.consistent:
        return "initial values: consistent"
    sentence = (
        f"initial values: inconsistent, by {initial.position_residual:.3g} in position and"
        f" {initial.velocity_residual:.3g} in velocity (the largest residuals of the equations as they are written)"
    )
    return sentence if initial.assembled is None else f"{sentence}; `assemble` moves the start"
