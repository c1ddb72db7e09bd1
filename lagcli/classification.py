"""Rows of a model -> verdicts: which differential constraints are integrable (D.3), each judged alone.

SymPy is loaded only where there is a differential constraint to judge.
"""

from __future__ import annotations

import dataclasses
from typing import Literal

from lagcli import model as nouns

Alone = Literal["exact", "integrable", "nonholonomic", "undecided"]
Kind = Literal["holonomic", "exact", "integrable", "nonholonomic", "undecided"]

DEFAULT_LIMIT = 20.0  # seconds for all rows of a model


@dataclasses.dataclass(frozen=True, slots=True)
class Verdict:
    """What is proved of one row. `integral` and `integrating_factor` are texts in the model's notation."""

    row: str
    declared: Literal["holonomic", "differential"]
    kind: Kind
    integral: str | None
    integrating_factor: str | None
    method: str
    proof: Literal["symbolic", "numeric", "none"]

    @property
    def alone(self) -> Alone:
        """The verdict of a differential row by itself."""
        assert self.kind != "holonomic"
        return self.kind


def differential(model: nouns.Model, limit: float = DEFAULT_LIMIT) -> tuple[Verdict, ...]:
    """Verdicts of the differential rows, in their order. `limit`: seconds, then `undecided`."""
    if not model.differential:
        return ()
    # Loaded here and not above: SymPy costs half a second that holonomic models need not spend.
    from lagcli.pfaffian import alike, translate
    from lagcli.pfaffian import limit as clock

    deadline = clock.after(limit)
    judge = alike.Judge()
    verdicts = []
    for row, form in translate.forms(model).items():
        if isinstance(form, translate.TooLarge):
            reason = "the form is too large for exact algebra"
            verdicts.append(Verdict(row, "differential", "undecided", None, None, reason, "none"))
            continue
        found = judge.classify(form, deadline)
        integral = None if found.integral is None else translate.written(found.integral)
        factor = None if found.integrating_factor is None else translate.written(found.integrating_factor)
        verdicts.append(Verdict(row, "differential", found.kind, integral, factor, found.method, found.proof))
    return tuple(verdicts)


def holonomic(model: nouns.Model, row_names: tuple[str, ...]) -> tuple[Verdict, ...]:
    """Verdicts of the rows declared in whole coordinates, `row_names` being those of the system."""
    texts = {row: law.equation.text for law in model.holonomic for row in law.rows}
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
