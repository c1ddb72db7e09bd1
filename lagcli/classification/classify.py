"""A model -> the classification of its differential rows: alone (D.3), and together with all rows they meet.

SymPy is loaded only where there is a differential row to judge.
"""

from __future__ import annotations

import time

from lagcli import numeric_flag
from lagcli.classification import coupling, places
from lagcli.classification.verdict import Classification
from lagcli.compile import NumericSystem, pattern
from lagcli.integrate.initial import State
from lagcli.mechanics.system import System

DEFAULT_LIMIT = 20.0  # seconds for all rows of a model
QUICK = 1.0  # seconds for numbers to show that nothing is integrable


def classify(
    system: System, numeric: NumericSystem, begin: State, limit: float = DEFAULT_LIMIT
) -> Classification:
    """The classification; `begin` is a consistent state. `limit`: seconds, then `undecided`.

    Raises `diagnostics.ModelError` where a combination of rows says dt = 0.
    """
    moving = pattern.depends_on_time(system)
    groups = coupling.groups(system)
    if not groups:
        return Classification((), (), moving)
    # Loaded here and not above: SymPy costs half a second that holonomic models need not spend.
    from lagcli.classification import judge

    deadline = time.monotonic() + limit
    court = judge.Judge(system, places.Places(system, numeric, begin), deadline)
    found = [court.judge(group) for group in groups]
    verdicts = {v.row: v for rows, _ in found for v in rows}
    names = [row.name for row in system.rows.rows[system.holonomic_count :]]
    return Classification(tuple(verdicts[name] for name in names), tuple(one for _, one in found), moving)


def certainly_nonholonomic(system: System, numeric: NumericSystem, begin: State) -> bool:
    """Whether numbers alone show that no combination of differential rows is integrable, which takes no SymPy."""
    points = places.Places(system, numeric, begin)
    for group in coupling.groups(system):
        found = numeric_flag.flag(system, points.listed, group.rows, time.monotonic() + QUICK)
        if not found.is_certain or found.extra[-1]:
            return False
    return True
