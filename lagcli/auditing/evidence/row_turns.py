"""Rows with an angle from `atan2` or `atan` are judged beyond its cut too: up to the jump of whole turns.

A run goes on smoothly there, so that f differs from what the file says by whole numbers of the constants by which one
turn of each angle changes it. These constants are given: nothing here knows the solver.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np

from lagcli.auditing.evidence.autodiff import Array

# Turns of all angles but one that are tried where a row has several: what no motion satisfies stays above its limit,
# as no more than some thousand values are compared.
MOST_TURNS = {1: 0, 2: 1000, 3: 20}


def reduced(f: Array, jumps: Mapping[int, tuple[float, ...]]) -> None:
    """Take the whole turns out of f (T, s), in place. jumps: the constants of each row, by its number."""
    for row, (size, *others) in jumps.items():
        if 1 + len(others) not in MOST_TURNS:
            continue
        x = f[:, row].real
        best = x - size * np.round(x / size)
        most = MOST_TURNS[1 + len(others)]
        for turns in itertools.product(range(-most, most + 1), repeat=len(others)):
            rest = x - sum(k * other for k, other in zip(turns, others, strict=True))
            rest = rest - size * np.round(rest / size)
            best = np.where(np.abs(rest) < np.abs(best), rest, best)
        f[:, row] += best - x
