"""Rows on the branch of a point: `abs`, `sign`, `min` and `max` replaced by what they are around it."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.equations import operation_graph

Floats = npt.NDArray[np.float64]

# In the first round a modulus may come to light, as the root of a square.
ROUNDS = 2
SWITCHES = {ca.OP_FABS, ca.OP_SIGN, ca.OP_FMIN, ca.OP_FMAX}


def of(
    value: ca.SX, inputs: Sequence[ca.SX], point: Sequence[Floats], near: float, otherwise: float
) -> ca.SX:
    """A column on the branch of a point; a switch that is within `near` of it stays, unless a branch that is not taken
    holds it, or is put on the side that is given `otherwise`, 1 or -1 in place of 0."""

    def sign_of(argument: ca.SX) -> float:
        found = float(ca.Function("switch", list(inputs), [argument])(*point))
        return float(np.sign(found)) if abs(found) > near else otherwise

    def visit(op: int, parts: list[ca.SX], result: ca.SX) -> ca.SX:
        if op not in SWITCHES:
            return result
        side = sign_of(parts[0] - parts[1] if len(parts) == 2 else parts[0])
        if not side:
            return result
        if len(parts) == 2:
            return parts[0 if (side > 0) == (op == ca.OP_FMAX) else 1]
        return side * parts[0] if op == ca.OP_FABS else ca.SX(side)

    # A root of a square that came to light is a modulus.
    for _ in range(ROUNDS):
        value = operation_graph.replayed(value, inputs, visit)
    return value
