"""The sentences of an audit: rows of the table of checks, what fails, and the figures beside them."""

from __future__ import annotations

import math

from lagcli.auditing.checks.audit_report import Check, TableLocation

UNREAD = 12  # names of columns that no check looks at


def failure(check: Check) -> str:
    """The head of the list of what fails."""
    if check.law:
        return f"{check.name} fails ({check.law}: {check.equation}):"
    return f"{check.name} fails:"


def work(figures: dict[str, float]) -> str:
    """The work of the constraints, virtual and real."""
    real = figures["work_of_constraints"]
    told = f"{real:.10g}" if math.isfinite(real) else "not known (the rows are too far apart)"
    return (
        f"Virtual work of R at most {figures['virtual_work']:.1e}; real work of R {told}, energy gained"
        f" {figures['energy_gained']:.10g}."
    )


def unread(names: tuple[str, ...]) -> str:
    """The columns that no check looks at."""
    shown = ", ".join(names[:UNREAD]) + (f" and {len(names) - UNREAD} others" if len(names) > UNREAD else "")
    return f"Columns that no check looks at: {shown}."


def fault(place: TableLocation) -> str:
    """An entry that is beyond its limit."""
    return f"{place.name} at t = {place.t:.9g}: {place.value:.3g}, the limit is {place.limit:.3g}"


def _where(place: TableLocation) -> str:
    """The place of an entry; one over a window names its times itself."""
    return place.name if " over t = " in place.name else f"{place.name}, t = {place.t:.6g}"


def wide_rows(checks: tuple[Check, ...]) -> list[tuple[str, ...]]:
    """The table of checks, its headers first."""
    lines: list[tuple[str, ...]] = [("check", "equation", "worst", "limit", "verdict", "where")]
    for check in checks:
        law = f"{check.equation} ({check.law})" if check.law else check.equation
        worst = check.worst
        lines.append(
            (
                check.name,
                law,
                f"{worst.value:.1e}" if worst else "-",
                f"{worst.limit:.1e}" if worst else "-",
                _verdict(check),
                _where(worst) if worst and worst.value else "-",
            )
        )
    return lines


def _verdict(check: Check) -> str:
    """The verdict; of a check that is judged in part how much of it."""
    if check.verdict != "partly judged" or check.fraction is None:
        return check.verdict
    return f"{max(1, math.floor(100 * check.fraction))} % judged"
