"""Hidden conditions from which the forces lead a motion away: no multiplier holds them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.analysis.classification import hidden_conditions
from lagcli.analysis.classification.verdict import Condition
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.linear.metric_rows import LocalRows
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]

# A condition that is off in accelerations by this part of them, or of what the velocities demand, is left.
LEFT = 1e-8
# Conditions that are off by less than this part of the largest are not named.
MAIN = 0.1


def reason(system: System, conditions: Sequence[Condition], state: State, a: Floats) -> str:
    """The hidden conditions of a system that accelerations a (n,) at a state do not satisfy, as a sentence, or
    nothing."""
    whole = hidden_conditions.extended(system, conditions)
    numeric = NumericSystem(whole)
    place = {row.name: i for i, row in enumerate(whole.rows.rows)}
    own = [place[hidden_conditions.equation(one)] for one in conditions]
    rows = LocalRows(numeric.rows(state.t, state.q, state.v, state.p)[0][own, :])
    gamma = np.array(numeric.force(state.t, state.q, state.v, state.p)[1]).ravel()[own]
    off, size = np.abs(rows.times(a) - gamma), rows.divisors * np.abs(a).max(initial=0.0) + np.abs(gamma)
    part = off / np.where(size > 0, size, 1.0)
    # What other conditions are off then follows from these.
    least = max(LEFT, MAIN * part.max(initial=0.0))
    left = [one for one, is_left in zip(conditions, part > least, strict=True) if is_left]
    if not left:
        return ""
    if len(left) == 1:
        (one,) = left
        verb = "demands" if len(one.rows) == 1 else "demand"
        who = hidden_conditions.quoted(one.rows)
        told = f"`{hidden_conditions.equation(one)}`, which {who} {verb} and no multiplier holds"
        return f"the forces lead off the hidden condition {told}"
    named = ", ".join(
        f"`{hidden_conditions.equation(one)}` (of {hidden_conditions.quoted(one.rows)})" for one in left
    )
    return f"the forces lead off the hidden conditions {named}, which no multiplier holds"
