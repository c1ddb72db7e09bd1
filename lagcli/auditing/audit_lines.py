"""The sentences of an audit: rows of the table of checks, what fails, the figures beside them, and what is unique."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from lagcli.auditing.checks.audit_report import Audit, Check, TableLocation

if TYPE_CHECKING:
    from lagcli.auditing.evidence.tolerances import Evidence

UNREAD = 12  # names of columns that no check looks at
SHOWN = 6  # names of rows in a sentence
MOST_FAULTS_LISTED = 6  # entries of a check that fails


class AuditLines(NamedTuple):
    """The lines of an audit. rows: the table of checks, its headers first; failures: of each check that fails the head,
    entries that are beyond their limits, and the number of others; sentences: those below, the verdict last."""

    rows: list[tuple[str, ...]]
    failures: list[tuple[str, list[str], int]]
    sentences: list[str]


def of(audit: Audit) -> AuditLines:
    """All lines of an audit."""
    failures = [
        (
            failure(check),
            [fault(location) for location in check.failing[:MOST_FAULTS_LISTED]],
            max(0, check.failures - MOST_FAULTS_LISTED),
        )
        for check in audit.checks
        if check.verdict == "fail"
    ]
    sentences = [sentence[0].upper() + sentence[1:] + "." for sentence in audit.sentences]
    if audit.figures:
        sentences.append(work(dict(audit.figures)))
    if audit.unread:
        sentences.append(unread(audit.unread))
    if audit.written is not None:
        sentences.append(audit.written.sentence())
    if audit.written_events is not None:
        sentences.append(audit.written_events.sentence("table of events"))
    return AuditLines(wide_rows(audit.checks), failures, [*sentences, audit.conclusion])


def failure(check: Check) -> str:
    """The head of the list of what fails."""
    if check.law:
        return f"{check.name} fails ({check.law}: {check.equation}):"
    return f"{check.name} fails:"


def work(figures: dict[str, float]) -> str:
    """The work of the constraints, virtual and real."""
    real = figures["work_of_constraints"]
    real_work = f"{real:.10g}" if math.isfinite(real) else "not known (the rows are too far apart)"
    return (
        f"Virtual work of R at most {figures['virtual_work']:.1e}; real work of R {real_work}, energy gained"
        f" {figures['energy_gained']:.10g}."
    )


def unread(names: tuple[str, ...]) -> str:
    """The columns that no check looks at."""
    shown = ", ".join(names[:UNREAD]) + (f" and {len(names) - UNREAD} others" if len(names) > UNREAD else "")
    return f"Columns that no check looks at: {shown}."


def fault(location: TableLocation) -> str:
    """An entry that is beyond its limit."""
    return f"{location.name} at t = {location.t:.9g}: {location.value:.3g}, the limit is {location.limit:.3g}"


def wide_rows(checks: tuple[Check, ...]) -> list[tuple[str, ...]]:
    """The table of checks, its headers first."""
    lines: list[tuple[str, ...]] = [("check", "equation", "worst", "limit", "verdict", "where")]
    for check in checks:
        law, worst = f"{check.equation} ({check.law})" if check.law else check.equation, check.worst
        verdict: str = check.verdict
        if check.verdict == "partly judged" and check.fraction is not None:
            verdict = f"{max(1, math.floor(100 * check.fraction))} % judged"
        if worst is None:
            lines.append((check.name, law, "-", "-", verdict, "-"))
            continue
        # An entry over a window names its times itself
        time = "" if " over t = " in worst.name else f", t = {worst.t:.6g}"
        where = f"{worst.name}{time}" if worst.value else "-"
        lines.append((check.name, law, f"{worst.value:.1e}", f"{worst.limit:.1e}", verdict, where))
    return lines


def uniqueness(e: Evidence) -> tuple[str, ...]:
    """Existence and uniqueness: rank, condition, consistency, and which multipliers are determined."""
    laws, d = e.laws, e.displacements
    times = e.record.t[e.looked_at]
    n = laws.index.n
    if not laws.C:
        return (f"there are no rows: all {n} coordinates are free, R = 0, and the motion is unique",)
    sentences = [_rank(laws.C, d.usual, n)]
    regular = ~d.is_singular
    if regular.any():
        worst = int((d.condition * regular).argmax())
        sentences.append(
            f"the condition of the rows, each divided by its length, is at most {d.condition[worst]:.2g}"
            f" (at t = {times[worst]:.6g})"
        )
    if d.is_singular.any():
        first = times[d.is_singular][0]
        sentences.append(
            f"{int(d.is_singular.sum())} of the {len(times)} rows of the table that were looked at are at or next to a"
            f" singular configuration, the first at t = {first:.6g}: multipliers may have poles there, R has none"
        )
    open_ = [
        row for row, unique in zip(laws.rows, d.is_unique[regular].all(axis=0), strict=True) if not unique
    ]
    if not regular.any():
        sentences.append(
            "which multipliers are determined is not known: no row of the table that was looked at is regular"
        )
    elif open_:
        shown = ", ".join(f"`{row}`" for row in open_[:SHOWN]) + (" ..." if len(open_) > SHOWN else "")
        sentences.append(
            f"{len(open_)} of {laws.C} multipliers are not determined ({shown}): their rows depend on each other;"
            " the others, R and the motion are unique"
        )
    else:
        sentences.append(
            "all multipliers are determined, lambda(0) too: they follow from (B M^-1 B^T) lambda = gamma - B M^-1 F"
            " at every instant"
        )
    return tuple(sentences)


def _rank(C: int, rank: int, n: int) -> str:
    if rank == C == 1:
        return f"the one row leaves {n - 1} of {n} directions free"
    if rank == C:
        rows = "the row is independent; it leaves" if C == 1 else f"the {C} rows are independent; they leave"
        return f"{rows} {n - rank} of {n} directions free"
    return f"the {C} rows have rank {rank}: {C - rank} too many; they leave {n - rank} of {n} directions free"
