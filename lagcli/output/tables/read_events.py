"""The table of incidents of a run read back: `simulate --events FILE`, or one of another program in its form."""

from __future__ import annotations

import os

import numpy as np

from lagcli.output.tables import incident_table, read_table
from lagcli.output.tables.incident_table import IncidentTable
from lagcli.output.tables.unreadable import SHOWN, UnreadableTable
from lagcli.simulation.run_state.incident import KINDS


def read_events(path: str | os.PathLike[str]) -> IncidentTable:
    """The incidents in a file: `t`, `kind`, `name` and columns of numbers, which may be any.

    Raises what `read_table.opened` raises, and `UnreadableTable` where one of those three is missing, a kind is none,
    and where times are no numbers or go back.
    """
    table = read_table.opened(path)
    missing = [name for name in incident_table.HEAD if name not in table.columns]
    if missing:
        raise UnreadableTable(f"{path} is no table of events: it has no column `{missing[0]}`")
    numbers = ["t", *(name for name in table.columns if name not in incident_table.HEAD)]
    values = table.take(numbers)
    kinds, names = table.words("kind"), table.words("name")
    if not len(kinds) == len(names) == len(values):
        raise UnreadableTable(f"{path} is no table of events: its columns have different lengths")
    for row, kind in enumerate(kinds, 1):
        if kind not in KINDS:
            raise UnreadableTable(
                f"{path} is no table of events: row {row} is of the kind {kind[:SHOWN]!r}; the kinds are"
                f" {', '.join(KINDS)}"
            )
    t = values[:, 0]
    bad = np.flatnonzero(~np.isfinite(t) | (np.diff(t, prepend=t[:1]) < 0))
    if bad.size:
        raise UnreadableTable(
            f"{path} is no table of events: the time in row {bad[0] + 1} is before that of the row above, or no number"
        )
    return IncidentTable((*incident_table.HEAD, *numbers[1:]), kinds, names, values)
