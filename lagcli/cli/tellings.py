"""What `check` and `dof --explain` tell a person."""

from __future__ import annotations

from lagcli import diagnostics
from lagcli.cli import console
from lagcli.degrees_of_freedom import DofCount
from lagcli.report import Report

COLOURS = {"nonholonomic": "yellow", "undecided": "red", "yes": "red"}


def report(found: Report, heading: bool) -> None:
    """The report of `check` on stdout."""
    title = found.title or found.path
    print(diagnostics.printable(f"{found.path}: {title}" if heading and found.title else title))
    print()
    if found.constraints:
        rows = []
        for constraint in found.constraints:
            verdict = constraint.verdict
            rows.append(
                [
                    verdict.row,
                    verdict.declared,
                    verdict.kind,
                    "" if verdict.integral is None else f"{verdict.integral} = const",
                    "" if verdict.integrating_factor in (None, "1") else str(verdict.integrating_factor),
                    "yes" if constraint.redundant else "",
                    verdict.method,
                ]
            )
        headers = ["constraint", "declared", "verdict", "integral", "factor", "redundant", "reason"]
        keep = [i for i, _ in enumerate(headers) if i < 3 or any(row[i] for row in rows)]
        console.table([headers[i] for i in keep], [[row[i] for i in keep] for row in rows], COLOURS)
        print()
    print("\n".join(count(found.dof)))
    print()
    print(_start(found))


def count(found: DofCount) -> list[str]:
    """The count, line by line."""
    plain = found.coordinates == 3 * found.particles
    label = "3N" if plain else "n"
    lines = [f"{found.particles} particles, {found.coordinates} coordinates ({label} = {found.coordinates})"]
    if found.configuration_dof is None:
        low, high = found.bounds
        return [*lines, f"degrees of freedom: undecided, between {low} and {high}", f"  {found.reason}"]
    s, m = found.holonomic, found.nonholonomic
    lines.append(f"s = {s} independent holonomic constraints")
    if found.redundant:
        lines.append(f"    {found.redundant} redundant row(s) left out: {', '.join(found.redundant_rows)}")
    lines.append(f"degrees of freedom: {label} - s = {found.coordinates} - {s} = {found.configuration_dof}")
    if m:
        lines.append(f"m = {m} independent nonholonomic constraints")
        total = f"{found.coordinates} - {s} - {m} = {found.velocity_dof}"
        lines.append(f"freedoms of the velocities: {label} - s - m = {total}")
    lines += [f"note: {note}" for note in found.notes]
    lines.append(f"proof: {found.proof}")
    return lines


def _start(found: Report) -> str:
    start = found.initial
    if start.consistent:
        return "initial values: consistent"
    return (
        f"initial values: inconsistent, by {start.position_residual:.3g} in position and"
        f" {start.velocity_residual:.3g} in velocity"
    )
