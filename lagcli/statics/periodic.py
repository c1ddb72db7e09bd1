"""The coordinates that are angles: all functions of a problem are periodic in them, by 2 pi, decided by their form."""

from __future__ import annotations

from typing import Final

from lagcli.compiled.program import Program

# Of a value as a function of one coordinate: it has the period, or grows by a whole multiple of the coordinate.
NOT_PERIODIC: Final = None
# Functions without which nothing is periodic.
WAVES = frozenset(("sin", "cos", "tan"))


def angles(programs: list[Program], n: int) -> tuple[bool, ...]:
    """For each of the n entries of argument 0 of all functions, whether each function has the period 2 pi in it."""
    if not any(name in WAVES for program in programs for name, *_ in program.steps):
        return (False,) * n
    return tuple(
        all(_is_periodic(program, k) for program in programs)
        and any(_occurs(program, k) for program in programs)
        for k in range(n)
    )


def _occurs(program: Program, place: int) -> bool:
    return any(name == "input" and ins == (0, place) for name, _, ins, _ in program.steps)


def _is_periodic(program: Program, place: int) -> bool:
    """True if every output stays the same when one input grows by 2 pi.

    Each register holds the number of times by which its value grows with the input, 0 for one that is periodic.
    """
    grows: dict[int, float | None] = {}
    constants: dict[int, float] = {}
    for name, out, ins, value in program.steps:
        if name == "output":
            if grows[ins[0]] != 0:
                return False
            continue
        target = out[0]
        known = constants.get(ins[0]) if ins and name != "input" else None
        constants.pop(target, None) if name != "const" else None
        if name == "input":
            grows[target] = 1.0 if ins == (0, place) else 0.0
        elif name == "const":
            grows[target], constants[target] = 0.0, value
        else:
            grows[target] = _growth(name, [grows[i] for i in ins], known)
    return True


def _growth(name: str, given: list[float | None], factor: float | None) -> float | None:
    """The growth of a result; `factor`: the first operand where it is a constant."""
    if all(each == 0 for each in given):
        return 0.0
    if any(each is NOT_PERIODIC for each in given):
        return NOT_PERIODIC
    a = given[0] or 0.0
    b = given[1] or 0.0 if len(given) > 1 else 0.0
    match name:
        case "add":
            return a + b
        case "sub":
            return a - b
        case "neg":
            return -a
        case "twice":
            return 2 * a
        case "assign":
            return a
        case "mul" if a == 0 and factor is not None:
            return factor * b
        case "sin" | "cos" | "tan" if a == round(a):
            return 0.0
    return NOT_PERIODIC
