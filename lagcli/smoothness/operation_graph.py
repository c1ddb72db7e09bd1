"""The operations of an expression, one after another: to look at them, or to put others in their place."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

import casadi as ca

from lagcli.expression import functions
from lagcli.smoothness.sized_function import SizedFunction

# (operation, operands, value) -> what stands for the value from there on.
Visit = Callable[[int, list[ca.SX], ca.SX], ca.SX]
T = TypeVar("T")
# The functions of the language that are operations, by their codes.
FUNCTIONS = {
    int(getattr(ca, f"OP_{(row.operation or row.name).upper()}")): row
    for row in functions.TABLE.values()
    if not row.casadi
}
# The expression of an operation, made when it is asked for.
Expression = Callable[[], ca.SX]
# (operation, what was found for its operands, its expression) -> what is found for it.
Look = Callable[[int, list[T], Expression], T]
# (the number of the input, the entry of it), or (None, the constant) -> what is found for it.
Leaf = Callable[[int | None, float], T]


@functools.cache
def names() -> dict[int, str]:
    """The names of operations by their codes."""
    return {getattr(ca, name): name[3:].lower() for name in dir(ca) if name.startswith("OP_")}


class Instruction(NamedTuple):
    """An operation of a function, the indices of its operands and of its result, and the constant that it is. The
    operand of an input is (input, entry), the result of an output (output, entry)."""

    op: int
    operands: Sequence[int]
    result: Sequence[int]
    constant: float


def instructions(function: ca.Function) -> list[Instruction]:
    """The operations of a function, operands before results."""
    return [
        Instruction(
            op := function.instruction_id(k),
            function.instruction_input(k),
            function.instruction_output(k),
            function.instruction_constant(k) if op == ca.OP_CONST else 0.0,
        )
        for k in range(function.n_instructions())
    ]


def replayed(value: ca.SX, inputs: Sequence[ca.SX], visit: Visit) -> ca.SX:
    """A column (k, 1) of the `inputs`, computed again operation by operation; `visit` may replace each result."""
    flat = [ca.vertsplit(part) if part.numel() > 1 else [part] for part in inputs]

    def leaf(number: int | None, entry: float) -> ca.SX:
        return ca.SX(entry) if number is None else flat[number][int(entry)]

    def look(op: int, parts: list[ca.SX], _: Expression) -> ca.SX:
        return visit(op, parts, applied(op, parts))

    return ca.vertcat(ca.SX(0, 1), *folded(value, inputs, leaf, look))


def applied(op: int, parts: Sequence[ca.SX]) -> ca.SX:
    """The expression of an operation on its operands."""
    return ca.SX.binary(op, *parts) if len(parts) == 2 else ca.SX.unary(op, *parts)


def folded(value: ca.SX, inputs: Sequence[ca.SX], leaf: Leaf[T], look: Look[T]) -> list[T]:
    """Found for each entry of a column (k, 1) of the `inputs`, by a look at its operations, operands before results."""
    function = SizedFunction("folded", list(inputs), [ca.densify(value)])
    expressions = functools.cache(function.instructions_sx)
    work: dict[int, T] = {}
    found: dict[int, T] = {}
    for k, (op, taken, given, constant) in enumerate(instructions(function)):
        if op == ca.OP_OUTPUT:
            found[given[1]] = work[taken[0]]
        elif op == ca.OP_INPUT:
            work[given[0]] = leaf(taken[0], taken[1])
        elif op == ca.OP_CONST:
            work[given[0]] = leaf(None, constant)
        else:
            parts = [work[index] for index in taken]
            work[given[0]] = look(op, parts, functools.partial(lambda number: expressions()[number], k))
    return [found[k] for k in range(value.numel())]
