"""Functions in an expression that may jump, and points near a start at which they do: found by Newton's method."""

from __future__ import annotations

import collections
import math
from collections.abc import Collection, Sequence

import casadi as ca
import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats, Integers
from lagcli.expression import intervals
from lagcli.frozen import frozen
from lagcli.smoothness import operation_graph, sides
from lagcli.smoothness.sized_function import SizedFunction
from lagcli.smoothness.switches import KINDS

# t, q and v.
StateValues = tuple[float, Floats, Floats]


# A check looks at so many members of a family, evenly spread, and in each value at so many switches of each word.
MEMBERS, SWITCHES = 16, 32
# The numbers between which a value lies, whatever state and parameters are.
Bounds = tuple[float, float]

ANY: Bounds = (-math.inf, math.inf)
# Of the operations that may jump the operand that changes its sign.
_OPERANDS = {
    **{code: 0 for code, row in operation_graph.FUNCTIONS.items() if row.jumps},
    ca.OP_DIV: 1,
    ca.OP_INV: 0,
}


@frozen
class Jumping:
    """A function that may jump where its `argument`, an SX (1, 1), changes its sign; watched: the same for a run, which
    passes where that does no harm; shape: the same where arguments differ in numbers and variables only."""

    word: str
    argument: ca.SX
    watched: ca.SX
    shape: int


# Of a result its shape, its bounds, and whether coordinates stand in it.
_Known = tuple[int, Bounds, bool]


def switches(value: ca.SX, inputs: Sequence[ca.SX]) -> list[Jumping]:
    """The switches of a column of `inputs`, the second of them q, in the order of its operations: those that depend on
    q and are not known to keep their sign. Those within the argument of another come first."""
    shapes: dict[tuple[object, ...], int] = {}
    names = operation_graph.names()
    found: dict[tuple[str, int], Jumping] = {}

    def known(key: tuple[object, ...], bounds: Bounds, is_moving: bool) -> _Known:
        return shapes.setdefault(key, len(shapes)), bounds, is_moving

    def visit(op: int, parts: list[_Known], expression: operation_graph.Expression) -> _Known:
        if op in _OPERANDS:
            word, index = KINDS[op].word, _OPERANDS[op]
            if op == ca.OP_DIV and parts[1][2] and 0.0 in parts[1][1]:
                index = 0  # of x/|x|, whose divisor touches zero on one side alone
            shape, bounds, is_moving = parts[index]
            if is_moving and not is_one_sided(bounds):
                call = expression()
                argument = call.dep(index)
                # The cut of `atan2` is on one side alone.
                watched = ca.if_else(call.dep(1) > 0, 1, argument) if op == ca.OP_ATAN2 else argument
                found.setdefault((word, watched.element_hash()), Jumping(word, argument, watched, shape))
        key = (op, *(part[0] for part in parts))
        bounds = intervals.FLOATS.result(names[op], *(part[1] for part in parts))
        return known(key, bounds, any(part[2] for part in parts))

    def leaf(given: int | None, number: float) -> _Known:
        bounds = ANY if given is not None else (number, number)
        return known(("input", given), bounds, given == 1)

    operation_graph.folded(value, inputs, leaf, visit)
    return list(found.values())


def examples(found: Sequence[Jumping], most: int) -> list[Jumping]:
    """At most so many of each word: of every shape the first, then of every shape the second, and so on."""
    seen: collections.Counter[tuple[str, int]] = collections.Counter()
    ranked: dict[str, list[tuple[int, int]]] = {}
    for index, switch in enumerate(found):
        key = switch.word, switch.shape
        ranked.setdefault(switch.word, []).append((seen[key], index))
        seen[key] += 1
    chosen = sorted(index for ranks in ranked.values() for _, index in sorted(ranks)[:most])
    return [found[index] for index in chosen]


@frozen
class Starts:
    """The starts from which points are sought: q (n, S) at one t, v and p; size: of q."""

    t: float
    q: Floats
    v: Floats
    p: ca.DM
    size: float


def starts(state: StateValues, p: Floats) -> Starts:
    """A state, and twelve points about it."""
    t, q, v = state
    random = np.random.default_rng(0)
    size = float(np.abs(q).max(initial=0.0)) or 1.0
    speed = v + (float(np.abs(v).max(initial=0.0)) or 1.0) * random.standard_normal(v.size)
    points = np.vstack([q, q + size * random.standard_normal((12, q.size))])
    return Starts(t, points.T, speed, ca.DM(p), size)


class Local:
    """A column as a function of t, coordinates, `moving`, rates and p; with_slopes: and its gradient by them."""

    def __init__(self, value: ca.SX, inputs: list[ca.SX], with_slopes: bool = False) -> None:
        t, q, v, p = inputs
        self.moving, self._rates = (np.flatnonzero(ca.which_depends(value, x, 1, False)) for x in (q, v))
        x, rates = (ca.vec(y[of.tolist()]) for y, of in ((q, self.moving), (v, self._rates)))
        column = ca.vertcat(value, ca.gradient(value, x)) if with_slopes else value
        self._function = SizedFunction("local", [t, x, rates, p], [ca.densify(column)])

    def at(self, begin: Starts, x: Floats) -> Floats:
        """The column (k, S) at points x (m, S)."""
        return np.array(self._function(begin.t, x, begin.v[self._rates], begin.p))


def spread(count: int) -> Integers:
    """The numbers of at most MEMBERS of so many, evenly spread: their text is the same, and they stand for all."""
    return np.unique(np.linspace(0, count - 1, min(count, MEMBERS)).round().astype(np.int64))


def word(
    value: ca.SX, inputs: list[ca.SX], near: tuple[StateValues, Floats], without: Collection[str] = ()
) -> str | None:
    """The function by which a value (1, 1) is found to jump across a switch near a state with its p, or None."""
    found = [each for each in switches(value, inputs) if each.word not in without]
    if not found:
        return None
    begin, whole, chosen = starts(*near), Local(value, inputs), examples(found, SWITCHES)
    return next((each.word for each in chosen if jumps(whole, each.argument, inputs, begin)), None)


def jumps(value: Local, argument: ca.SX, inputs: list[ca.SX], begin: Starts) -> bool:
    """True if a value (1, 1) jumps where the argument of a switch in it changes its sign, at a point that is found."""
    switch = Local(argument, inputs, with_slopes=True)
    with np.errstate(all="ignore"):
        # The starts (A,) from which Newton's method comes upon the switch, points (m, A) there, and ways across it
        x = begin.q[switch.moving]
        slopes = np.zeros_like(x)
        is_going, is_there = np.ones(x.shape[1], dtype=bool), np.zeros(x.shape[1], dtype=bool)
        for _ in range(30):
            found = switch.at(begin, x)
            value_there, slope = found[0], found[1:]
            square = (slope * slope).sum(axis=0)
            is_going &= np.isfinite(value_there) & np.isfinite(square) & (square > 0)
            step = np.where(is_going, value_there / square * slope, 0.0)
            x = x - step
            arrived = is_going & (np.abs(step).max(axis=0) <= doubles.ZERO * begin.size)
            slopes[:, arrived] = slope[:, arrived] / np.sqrt(square[arrived])
            is_there |= arrived
            is_going &= ~arrived
            if not is_going.any():
                break
        numbers = np.flatnonzero(is_there)
        centres, across = x[:, numbers], begin.size * math.sqrt(doubles.ZERO) * slopes[:, numbers]
        if not numbers.size:
            return False

        def point(part: Floats) -> Floats:
            return centres + (2 * part - 1) * across

        none = np.zeros(numbers.size)
        sign = np.sign(switch.at(begin, point(none))[0])
        at = begin.q[value.moving][:, numbers]
        own = np.searchsorted(value.moving, switch.moving)
        values = []
        ends = sides.bracket(lambda x: np.sign(switch.at(begin, point(x))[0]) == sign, none, none + 1.0)
        for part in sides.beside(*ends):
            at[own] = point(part)
            values.append(value.at(begin, at)[0])
        return bool(sides.value_jumps(tuple(values)).any())


def is_one_sided(bounds: Bounds) -> bool:
    """True for what changes its sign nowhere, though it may touch zero."""
    return bounds[0] >= 0.0 or bounds[1] <= 0.0
