"""A function over many columns at once: each of its operations on all of them, one after another, by numpy.

Of operations that IEEE 754 rounds correctly alone, so that each number has the bits that CasADi gives it; of others
there is no program.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np

from lagcli.arrays import Floats
from lagcli.smoothness import operation_graph

Operation = Callable[..., Any]


def _where(condition: Floats, x: Floats, out: Floats) -> None:
    out[...] = np.where(condition != 0.0, x, 0.0)


OPERATIONS: dict[int, Operation] = {
    ca.OP_ADD: np.add,
    ca.OP_SUB: np.subtract,
    ca.OP_MUL: np.multiply,
    ca.OP_DIV: np.divide,
    ca.OP_NEG: np.negative,
    ca.OP_FABS: np.fabs,
    ca.OP_SQ: lambda x, out: np.multiply(x, x, out),
    ca.OP_TWICE: lambda x, out: np.add(x, x, out),
    ca.OP_INV: lambda x, out: np.divide(1.0, x, out),
    ca.OP_SQRT: np.sqrt,
    ca.OP_FMIN: np.fmin,
    ca.OP_FMAX: np.fmax,
    ca.OP_LT: np.less,
    ca.OP_LE: np.less_equal,
    ca.OP_AND: np.logical_and,
    ca.OP_OR: np.logical_or,
    ca.OP_NOT: np.logical_not,
    ca.OP_IF_ELSE_ZERO: _where,
}


class ColumnProgram:
    """The operations of a function, to be bound to columns; is_whole: there are no others."""

    def __init__(self, function: ca.Function) -> None:
        self._listed = operation_graph.instructions(function) if function.is_a("SXFunction") else []
        others = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST}
        self.is_whole = bool(self._listed) and all(
            op in OPERATIONS or op in others for op, *_ in self._listed
        )

    def bound(self, inputs: Sequence[Floats], wanted: Sequence[int]) -> BoundColumns:
        """The program with `inputs`, each a column (m, 1) that all share or a column each (m, k), that makes those
        entries of the first result that are `wanted`."""
        found = BoundColumns(len(wanted), max(each.shape[1] for each in inputs))
        place = {entry: i for i, entry in enumerate(wanted)}
        registers: dict[int, Floats] = {}
        memory: dict[tuple[int, int], Floats] = {}
        needed = _needed(self._listed, place)
        for (op, taken, given, constant), is_needed in zip(self._listed, needed, strict=True):
            if not is_needed:
                continue
            if op == ca.OP_OUTPUT:
                found.calls.append((np.copyto, (found.results[place[given[1]]], registers[taken[0]])))
            elif op == ca.OP_INPUT:
                registers[given[0]] = inputs[taken[0]][taken[1]]
            elif op == ca.OP_CONST:
                registers[given[0]] = np.array([constant])
            else:
                operands = [registers[index] for index in taken]
                size = max(each.size for each in operands)
                out = memory.setdefault((given[0], size), np.zeros(size))
                found.calls.append((OPERATIONS[op], (*operands, out)))
                registers[given[0]] = out
        return found


class BoundColumns:
    """A program bound to memory: `calls` are its operations, `results` (r, k) what they make."""

    def __init__(self, count: int, k: int) -> None:
        self.results = np.zeros((count, k))
        self.calls: list[tuple[Operation, tuple[Floats, ...]]] = []

    def run(self) -> Floats:
        """The results, for the inputs as they are now."""
        with np.errstate(all="ignore"):
            for operation, arrays in self.calls:
                operation(*arrays)
        return self.results


def _needed(listed: Sequence[operation_graph.Instruction], wanted: dict[int, int]) -> list[bool]:
    """Operations that wanted entries of the first result are made of."""
    registers, found = set[int](), []
    for op, taken, given, _ in reversed(listed):
        if op == ca.OP_OUTPUT:
            is_needed = given[0] == 0 and given[1] in wanted
        else:
            is_needed = given[0] in registers
            registers.discard(given[0])
        if is_needed and op not in (ca.OP_INPUT, ca.OP_CONST):
            registers.update(taken)
        found.append(is_needed)
    return found[::-1]
