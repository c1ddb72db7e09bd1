"""Hidden conditions from which the forces lead a motion away: no multiplier holds them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.classification import hidden
from lagcli.classification.verdict import Condition
from lagcli.compile import NumericSystem
from lagcli.constraint_rows import Rows
from lagcli.integrate.initial import State
from lagcli.mechanics.system import System

Floats = npt.NDArray[np.float64]

# A condition that is off in accelerations by this part of them, or of what the velocities demand, is left.
LEFT = 1e-8


def reason(system: System, conditions: Sequence[Condition], state: State, a: Floats) -> str:
    """The hidden conditions of a system that accelerations a (n,) at a state do not satisfy, as a sentence, or
    nothing."""
    whole = hidden.extended(system, conditions)
    numeric = NumericSystem(whole)
    place = {row.name: i for i, row in enumerate(whole.rows.rows)}
    own = [place[hidden.equation(one)] for one in conditions]
    rows = Rows(numeric.rows(state.t, state.q, state.v, state.p)[0][own, :])
    gamma = np.array(numeric.force(state.t, state.q, state.v, state.p)[1]).ravel()[own]
    off, size = np.abs(rows.times(a) - gamma), rows.divisors * np.abs(a).max(initial=0.0) + np.abs(gamma)
    left = [one for one, is_off in zip(conditions, off > LEFT * size, strict=True) if is_off]
    if not left:
        return ""
    named = " and ".join(
        f"`{hidden.equation(one)}`, which {hidden.quoted(one.rows)}"
        f" {'demands' if len(one.rows) == 1 else 'demand'}"
        for one in left
    )
    return f"the forces lead off the hidden condition{'s' if len(left) > 1 else ''} {named} and no multiplier holds"
