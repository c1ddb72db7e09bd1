"""The functions in an expression that may jump, and what changes its sign where they do."""

from __future__ import annotations

import collections
from collections.abc import Sequence

import casadi as ca

from lagcli.equations import operation_graph, value_bounds
from lagcli.frozen import frozen

QUOTIENT = "a quotient"
# The operation, with the operand that changes its sign.
_WORDS = {
    ca.OP_SIGN: ("sign", 0),
    ca.OP_ATAN2: ("atan2", 0),
    ca.OP_ATAN: ("atan", 0),
    ca.OP_DIV: (QUOTIENT, 1),
    ca.OP_INV: (QUOTIENT, 0),
}


@frozen
class Switch:
    """A function that may jump where its `argument`, an SX (1, 1), changes its sign.

    watched: the same for a run, which passes the places where the sign does no harm; shape: a number, the same where
    arguments differ in their numbers and variables only, as those of siblings.
    """

    word: str
    argument: ca.SX
    watched: ca.SX
    shape: int


# Of a result its shape, its bounds, and whether coordinates stand in it.
_Known = tuple[int, value_bounds.Bounds, bool]


def of(value: ca.SX, inputs: Sequence[ca.SX]) -> list[Switch]:
    """The switches of a column of `inputs`, the second of them q, in the order of its operations: those that depend on
    q and are not known to keep their sign. Those within the argument of another come first."""
    shapes: dict[tuple[object, ...], int] = {}
    found: dict[tuple[str, int], Switch] = {}

    def known(key: tuple[object, ...], bounds: value_bounds.Bounds, is_moving: bool) -> _Known:
        return shapes.setdefault(key, len(shapes)), bounds, is_moving

    def visit(op: int, parts: list[_Known], expression: operation_graph.Expression) -> _Known:
        if op in _WORDS:
            word, place = _WORDS[op]
            shape, bounds, is_moving = parts[place]
            if is_moving and not value_bounds.is_one_sided(bounds):
                call = expression()
                argument = call.dep(place)
                # The cut of `atan2` is on one side alone.
                watched = ca.if_else(call.dep(1) > 0, 1, argument) if op == ca.OP_ATAN2 else argument
                found.setdefault((word, watched.element_hash()), Switch(word, argument, watched, shape))
        key = (op, *(part[0] for part in parts))
        return known(key, value_bounds.of(op, [part[1] for part in parts]), any(part[2] for part in parts))

    def leaf(given: int | None, number: float) -> _Known:
        bounds = value_bounds.ANY if given is not None else (number, number)
        return known(("input", given), bounds, given == 1)

    operation_graph.folded(value, inputs, leaf, visit)
    return list(found.values())


def examples(switches: Sequence[Switch], most: int) -> list[Switch]:
    """At most so many of each word: of every shape the first, then of every shape the second, and so on."""
    seen: collections.Counter[tuple[str, int]] = collections.Counter()
    ranked: dict[str, list[tuple[int, int]]] = {}
    for place, switch in enumerate(switches):
        key = switch.word, switch.shape
        ranked.setdefault(switch.word, []).append((seen[key], place))
        seen[key] += 1
    chosen = sorted(place for ranks in ranked.values() for _, place in sorted(ranks)[:most])
    return [switches[place] for place in chosen]
