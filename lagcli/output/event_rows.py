"""Rows of the instants of incidents among those of the grid, `--event-rows`."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.simulation.run_state.incident import Incident

Floats = npt.NDArray[np.float64]


def merged(rows: Floats, incidents: Sequence[Incident]) -> Floats:
    """Rows (k, columns) with two more for each instant, before and after, ahead of a row of the grid at that time.

    incidents: in the order of time, those of one instant next to each other. Columns beyond their lines
    are nan.
    """
    if not incidents:
        return rows
    pairs: list[Floats] = []
    times: list[float] = []
    for t, group in itertools.groupby(incidents, key=lambda incident: incident.t):
        found = list(group)
        for line in (found[0].before, found[-1].after):
            row = np.full(rows.shape[1], np.nan)
            row[0], row[1 : 1 + line.size] = t, line
            pairs.append(row)
            times.append(t)
    more = np.array(pairs) + 0.0  # no table shows -0.0
    return np.insert(rows, np.searchsorted(rows[:, 0], times), more, axis=0)
