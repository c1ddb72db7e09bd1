"""A function as the list of its operations, for any arithmetic."""

from __future__ import annotations

import functools

import casadi as ca

from lagcli.frozen import frozen_value


@functools.cache
def _names() -> dict[int, str]:
    """The names of operations by their codes."""
    return {getattr(ca, name): name[3:].lower() for name in dir(ca) if name.startswith("OP_")}


@frozen_value
class Program:
    """The operations of a function written out.

    steps: (operation, register of the result, registers or, for inputs and outputs, indices; value of a constant).
    registers: how many there are; results: the number of values of the first output.
    """

    steps: tuple[tuple[str, tuple[int, ...], tuple[int, ...], float], ...]
    registers: int
    results: int


def written_out(function: ca.Function) -> Program:
    """The operations of an expanded function, whose first output is dense."""
    steps = []
    for k in range(function.n_instructions()):
        code = function.instruction_id(k)
        value = function.instruction_constant(k) if code == ca.OP_CONST else 0.0
        steps.append(
            (
                _names()[code],
                tuple(function.instruction_output(k)),
                tuple(function.instruction_input(k)),
                value,
            )
        )
    return Program(tuple(steps), int(function.sz_w()), int(function.numel_out(0)))
