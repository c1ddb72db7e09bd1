"""Pieces of space on which rows are analytic, and rows as they are on the piece of a point: what holds at one point of
a piece at generic ones holds at nearly all.

A piece ends where `abs`, `sign`, `min` or `max` switches, where a root or a power has no derivative, where `asin` or
`acos` comes to the end of its range (asin(sin(x)) turns back there), at the cut of `atan2`, and at poles.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.smoothness import operation_graph, switches
from lagcli.smoothness.sized_function import SizedFunction

Floats = npt.NDArray[np.float64]

# An end that is touched between two points is seen where a parabola through three values comes this near to zero, as
# a part of the smaller of the outer ones.
TOUCHED = 0.1
# In the first round a modulus may come to light, as the root of a square.
ROUNDS = 2


class AnalyticPieces:
    """The ends of the pieces of a matrix of functions of some `inputs`, the first of which is the point."""

    def __init__(self, value: ca.SX, inputs: list[ca.SX]) -> None:
        found = [(each.argument, each.condition) for each in switches.among(value, inputs)]
        moving = [(end, over) for end, over in found if end is not None and ca.depends_on(end, inputs[0])]
        self.count = len(moving)
        values = [each[part] for part in range(2) for each in moving]
        self._values = SizedFunction("pieces", inputs, [ca.vertcat(ca.SX(0, 1), *values)])

    def end_between(self, path: Floats, *others: Floats) -> bool:
        """True if a path (points, N) may leave the piece that it begins on, by crossing an end or by touching it."""
        if not self.count:
            return False
        values = np.array([np.array(self._values(point, *others)).ravel() for point in path])
        u, conditions = values[:, : self.count], values[:, self.count :]
        if not np.isfinite(values).all():
            return True
        # A start that is so near to an end lies on it.
        u = np.where(np.abs(u) <= doubles.ZERO * np.abs(u).max(axis=0, initial=0.0), 0.0, u)
        changes = (u[:-1] * u[1:] < 0) | ((u[:-1] != 0) & (u[1:] == 0))
        return bool(
            (changes & (np.maximum(conditions[:-1], conditions[1:]) > 0)).any() or _touched(np.abs(u)).any()
        )


def _touched(u: Floats) -> npt.NDArray[np.bool_]:
    """Marks of where |u| (points, K) is least between two points, by a parabola, and next to nothing there."""
    before, here, after = u[:-2], u[1:-1], u[2:]
    bend = before - 2 * here + after
    with np.errstate(divide="ignore", invalid="ignore"):
        least = here - (before - after) ** 2 / (8 * bend)
    is_least = (here <= before) & (here <= after) & (bend > 0)
    return is_least & (least <= TOUCHED * np.minimum(before, after))


def on_branch(value: ca.SX, inputs: Sequence[ca.SX], point: Sequence[Floats], near: float) -> ca.SX:
    """A column on the branch of a point; a switch that is within `near` of it stays, unless a branch that is not taken
    holds it."""

    def visit(op: int, parts: list[ca.SX], result: ca.SX) -> ca.SX:
        argument = switches.comparison(op, parts)
        if argument is None:
            return result
        found = float(SizedFunction("switch", list(inputs), [argument])(*point))
        return switches.on_side(op, parts, float(np.sign(found))) if abs(found) > near else result

    # A root of a square that came to light is a modulus.
    for _ in range(ROUNDS):
        value = operation_graph.replayed(value, inputs, visit)
    return value
