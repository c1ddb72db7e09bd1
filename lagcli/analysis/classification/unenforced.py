"""Notes for differential constraints whose first integrals are unknown and therefore not enforced."""

from __future__ import annotations

from collections.abc import Iterable

from lagcli.analysis.classification.verdict import Classification

MOST_NAMES = 4  # more rows are counted and not named


def notes(found: Classification) -> tuple[str, ...]:
    """A note on all rows with integrals that were not found, and one on those of which nothing was decided."""
    unknown: list[str] = []
    undecided: list[str] = []
    for group in found.groups:
        if not group.is_decided:
            undecided += group.rows
        elif len(group.integrals) + len(group.passing) < group.flag[-1]:
            # Where no row alone lies in the integrable part a combination of them does.
            unknown += [row for row in group.rows if row in group.inside] or group.rows
    told = []
    if unknown:
        told.append(f"not all integrals of {_named(unknown)} were found")
    if undecided:
        told.append(f"it is undecided whether {_named(undecided)} can be integrated")
    return tuple(
        f"{what}: integrals that are not known are enforced at velocity level only, to the integration tolerance"
        for what in told
    )


def _named(rows: Iterable[str]) -> str:
    names = [f"`{row}`" for row in rows]
    more = len(names) - MOST_NAMES
    return ", ".join(names) if more <= 0 else f"{', '.join(names[:MOST_NAMES])} and {more} more"
