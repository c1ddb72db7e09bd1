"""The rows that act while some contacts are closed."""

from __future__ import annotations

from collections.abc import Sequence

from lagcli.compiled import NumericSystem
from lagcli.compiled.selection import Selection
from lagcli.linear import independent_rows
from lagcli.linear.metric_rows import MetricRows
from lagcli.simulation.contact_instant import ContactInstant


def selection(open_: Selection, here: ContactInstant, closed: Sequence[int], rows: int) -> Selection:
    """The selection with these contacts closed; open_: that with none; rows: C, the number of equality rows.

    A contact whose row depends on those before it shares their forces as any redundant row does.
    """
    contacts = range(rows, open_.count)
    if not closed:
        return Selection(open_.kept, open_.circuits, tuple(contacts))
    numbers = [*open_.kept, *(rows + j for j in sorted(closed))]
    found = MetricRows(here.rows_of(sorted(closed)), here.metric)
    kept = list(range(len(open_.kept)))
    if found.are_independent:
        kept = list(range(len(numbers)))
    else:
        for place in range(len(open_.kept), len(numbers)):
            if found.take([*kept, place]).are_independent:
                kept.append(place)
    circuits = independent_rows.over(found, tuple(kept)).selection.circuits
    shared = tuple(tuple(numbers[k] for k in circuit) for circuit in circuits)
    inactive = tuple(i for i in contacts if i not in set(numbers))
    return Selection(tuple(numbers[k] for k in kept), (*open_.circuits, *shared), inactive)


def closed_in(numeric: NumericSystem, rows: int) -> tuple[int, ...]:
    """The contacts that are closed, by their numbers among contacts."""
    return tuple(i - rows for i in numeric.closed_rows)
