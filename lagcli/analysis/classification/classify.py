"""A model -> the classification of its differential rows: alone (D.3), and together with all rows they meet.

SymPy is loaded only where there is a differential row to judge.
"""

from __future__ import annotations

import time

from lagcli import progress
from lagcli.analysis.classification.case import Case
from lagcli.analysis.classification.verdict import Classification
from lagcli.model import settings

QUICK = 1.0  # seconds for numbers to show that nothing is integrable


@progress.phase("classifying the constraints")
def classify(case: Case, limit: float = settings.LIMIT) -> Classification:
    """The classification. `limit`: seconds for all rows, then `undecided`.

    Raises `diagnostics.ModelError` where a combination of rows says dt = 0.
    """
    if not case.groups:
        return Classification((), (), case.depends_on_time)
    # Loaded here and not above: SymPy costs half a second that holonomic models need not spend.
    from lagcli.analysis.classification import classifier

    court = classifier.Classifier(case, time.monotonic() + limit)
    found = [court.judge(group) for group in case.groups]
    verdicts = {v.row: v for rows, _ in found for v in rows}
    names = [row.name for row in case.system.rows.rows[case.system.holonomic_count :]]
    return Classification(
        tuple(verdicts[name] for name in names), tuple(one for _, one in found), case.depends_on_time
    )


def certainly_nonholonomic(case: Case) -> bool:
    """True if numbers alone show that no combination of differential rows is integrable, which takes no SymPy."""
    flags = (case.flag(group, time.monotonic() + QUICK) for group in case.groups)
    return all(found.is_certain and not found.extra[-1] for found in flags)
