"""Verdicts that need no search: of rows declared in whole coordinates, and of one-sided ones."""

from __future__ import annotations

from lagcli.analysis.classification.verdict import Verdict
from lagcli.model import model as nouns


def holonomic(model: nouns.Model, row_names: tuple[str, ...]) -> tuple[Verdict, ...]:
    """Verdicts of the rows declared in whole coordinates, `row_names` being those of the system."""
    texts = {row for law in model.holonomic for row in law.rows}
    bodies = {body.name for body in model.rigid}
    verdicts = []
    for row in row_names:
        if row in texts:
            method = "declared in whole coordinates"
        elif row.rpartition(".")[0] in bodies:
            method = f"row of the rigid body `{row.rpartition('.')[0]}`"
        else:
            continue
        verdicts.append(Verdict(row, "holonomic", "holonomic", None, None, method, "symbolic"))
    return tuple(verdicts)


def one_sided(model: nouns.Model) -> tuple[Verdict, ...]:
    """Verdicts of the one-sided constraints, in their order."""
    rows = (row for law in model.inequality for row in law.rows)
    method = "declared as one-sided: not counted in s"
    return tuple(Verdict(row, "inequality", "inequality", None, None, method, "symbolic") for row in rows)
