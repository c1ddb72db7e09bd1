"""Rows that share coordinates belong together; uncoupled groups are classified apart.

A differential row takes part with every coordinate it moves or depends on, a holonomic row with those of f.
Time does not couple: whatever dt is, the others can follow.
"""

from __future__ import annotations

import dataclasses

from lagcli.compiled import pattern
from lagcli.equations.system import System


@dataclasses.dataclass(frozen=True, slots=True)
class CoupledGroup:
    """Numbers of coupled rows: the differential ones, and the holonomic ones that share coordinates with them."""

    differential: tuple[int, ...]
    holonomic: tuple[int, ...]

    @property
    def rows(self) -> tuple[int, ...]:
        """All of them, in their order."""
        return (*self.holonomic, *self.differential)


def groups(system: System) -> tuple[CoupledGroup, ...]:
    """The groups that hold differential rows, in the order of their first ones."""
    count, s = len(system.rows.rows), system.holonomic_count
    if s == count:
        return ()
    # Rows and coordinates are the nodes of a graph; a pair joins its row to its coordinate.
    leader = list(range(count + system.symbols.q.numel()))
    for row, k in zip(*(found.tolist() for found in pattern.coordinates(system)), strict=True):
        leader[_find(leader, row)] = _find(leader, count + k)
    together: dict[int, list[int]] = {_find(leader, row): [] for row in range(s, count)}
    for row in range(count):
        if _find(leader, row) in together:
            together[_find(leader, row)].append(row)
    return tuple(
        CoupledGroup(tuple(row for row in rows if row >= s), tuple(row for row in rows if row < s))
        for rows in together.values()
    )


def _find(leader: list[int], k: int) -> int:
    while leader[k] != k:
        leader[k] = leader[leader[k]]
        k = leader[k]
    return k
