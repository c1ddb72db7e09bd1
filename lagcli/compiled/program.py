"""A function as the list of its operations, for any arithmetic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import casadi as ca

from lagcli.frozen import frozen_value

T = TypeVar("T")


@frozen_value
class Program:
    """steps: (operation, register of the result, registers or, for inputs and outputs, indices; value of a constant);
    results: the number of values of the first output."""

    steps: tuple[tuple[str, tuple[int, ...], tuple[int, ...], float], ...]
    results: int

    def run(
        self,
        inputs: Sequence[Sequence[T]],
        constant: Callable[[float], T],
        result: Callable[..., T],
    ) -> list[T]:
        """The values of the first output in an arithmetic: constants, and results of operations by their names."""
        registers: dict[int, T] = {}
        outputs = [constant(0.0)] * self.results  # also of entries that are none by structure
        for name, out, of, value in self.steps:
            if name == "input":
                registers[out[0]] = inputs[of[0]][of[1]]
            elif name == "const":
                registers[out[0]] = constant(value)
            elif name == "output":
                if out[0] == 0:
                    outputs[out[1]] = registers[of[0]]
            elif of[1:]:
                registers[out[0]] = result(name, registers[of[0]], registers[of[1]])
            else:
                registers[out[0]] = result(name, registers[of[0]])
        return outputs


def written_out(function: ca.Function) -> Program:
    """The operations of an expanded function, whose first output is dense."""
    from lagcli.smoothness import operation_graph  # here, as most commands write nothing out

    names = operation_graph.names()
    steps = (
        (names[op], tuple(out), tuple(of), value)
        for op, of, out, value in operation_graph.instructions(function)
    )
    return Program(tuple(steps), int(function.numel_out(0)))
