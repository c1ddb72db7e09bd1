"""Contacts whose expressions are made of the same operations, on other coordinates: one function serves all of them.

Of thousands of contacts, as between each two of many spheres, there are a few kinds. Operations are compared, and not
the formulas of a file, so that the numbers of one contact are the same to the bit whether they are asked for alone,
with others of its kind, or in one graph of all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from lagcli.arrays import Indices
from lagcli.compiled.parts import Parts
from lagcli.smoothness import operation_graph
from lagcli.smoothness.sized_function import SizedFunction


class ContactKindParameters:
    """Numbers of contacts. The tests are of `tests/unit/test_contact_kinds.py`."""

    __slots__ = ()

    many: int = 256
    """Of more contacts than these each function calls that of a kind for each, where else all operations make one
    graph, and those that are not near are asked for their gaps alone: it is faster from some hundred on, and the bits
    are the same (`test_many_contacts_have_the_bits_of_few`)."""


PARAMETERS = ContactKindParameters()


class ContactKind(NamedTuple):
    """members (k,): the numbers of the contacts; coordinates (k, m): of q, those that each depends on, ascending;
    entries (k, e): the places of its entries among those of G, and at (e,) the columns of these among its coordinates.
    """

    members: Indices
    coordinates: Indices
    entries: Indices
    at: Indices


def found(parts: Parts) -> list[ContactKind]:
    """The kinds of the contacts of a system."""
    contacts, n = parts.contacts, parts.v.numel()
    pattern = contacts.G.sparsity()
    rows, columns = (np.asarray(each, dtype=np.intp) for each in pattern.get_triplet())
    order = np.argsort(rows, kind="stable")
    ends = np.searchsorted(rows[order], np.arange(contacts.count + 1)).tolist()
    values = [ca.densify(x) for x in (contacts.g, contacts.g_t, contacts.gamma)]
    value = ca.vertcat(*values, ca.vec(contacts.G.nz[:]))
    graph = _Graph(value, [parts.t, parts.y[:n], parts.v, parts.p])
    of_state = (1, 2)  # of the inputs q and v, which are numbered by the coordinates of a contact
    alike: dict[tuple[object, ...], list[tuple[int, list[int], list[int]]]] = {}
    for j in range(contacts.count):
        own = order[ends[j] : ends[j + 1]].tolist()
        results = [j + part * contacts.count for part in range(3)]
        program, leaves = graph.program([*results, *(3 * contacts.count + entry for entry in own)])
        coordinates = sorted({i for number, i in leaves if number in of_state} | set(columns[own].tolist()))
        rank = {coordinate: i for i, coordinate in enumerate(coordinates)}
        taken = tuple((number, rank[i] if number in of_state else i) for number, i in leaves)
        at = tuple(rank[i] for i in columns[own].tolist())
        alike.setdefault((program, taken, len(coordinates), at), []).append((j, coordinates, own))
    kinds = []
    for members in alike.values():
        numbers, *lists = (np.array(each, dtype=np.intp) for each in zip(*members, strict=True))
        of_q, of_rows = (each.reshape(numbers.size, -1) for each in lists)
        at = np.searchsorted(of_q[0], columns[of_rows[0]])
        kinds.append(ContactKind(numbers, of_q, of_rows, at))
    return kinds


class _Graph:
    """The operations of a column, of which those of some entries are told by themselves."""

    def __init__(self, value: ca.SX, inputs: Sequence[ca.SX]) -> None:
        function = SizedFunction("kinds", list(inputs), [value])
        self._nodes: list[tuple[object, tuple[int, ...]]] = []
        self._results: dict[int, int] = {}
        work: dict[int, int] = {}
        for op, taken, given, constant in operation_graph.instructions(function):
            if op == ca.OP_OUTPUT:
                self._results[given[1]] = work[taken[0]]
                continue
            if op == ca.OP_INPUT:
                node: tuple[object, tuple[int, ...]] = ((taken[0], taken[1]), ())
            elif op == ca.OP_CONST:
                node = (float(constant).hex(), ())
            else:
                node = (op, tuple(work[index] for index in taken))
            work[given[0]] = len(self._nodes)
            self._nodes.append(node)

    def program(self, results: Sequence[int]) -> tuple[tuple[object, ...], tuple[tuple[int, int], ...]]:
        """The operations that some entries are made of, numbered in the order of their first use, and the inputs among
        them."""
        numbers: dict[int, int] = {}
        program: list[object] = []
        leaves: list[tuple[int, int]] = []
        for result in results:
            stack = [self._results[result]]
            while stack:
                node = stack[-1]
                if node in numbers:
                    stack.pop()
                    continue
                what, operands = self._nodes[node]
                left = [operand for operand in operands if operand not in numbers]
                if left:
                    stack.extend(reversed(left))
                    continue
                stack.pop()
                numbers[node] = len(program)
                if isinstance(what, tuple):
                    program.append(("input", len(leaves)))
                    leaves.append(what)
                else:
                    program.append((what, tuple(numbers[operand] for operand in operands)))
            program.append(numbers[self._results[result]])
        return tuple(program), tuple(leaves)


# An expression, of numbers one by one or of arrays: SX or MX.
X = Any


def columns(x: X, at: Indices) -> X:
    """Entries of a column at some places (k, m), as a matrix (m, k)."""
    return ca.reshape(x[at.ravel().tolist()], at.shape[1], at.shape[0])


def of_each(
    kinds: Sequence[ContactKind], functions: Sequence[ca.Function], arguments: Callable[[Indices], list[X]]
) -> list[X]:
    """The numbers that functions of each kind give for its contacts, contact after contact. arguments: of a function,
    by the coordinates (k, m) of contacts; one that has no column for each is that of all."""
    found = []
    for kind, function in zip(kinds, functions, strict=True):
        given = arguments(kind.coordinates)
        if isinstance(given[0], ca.MX):
            same = [i for i, x in enumerate(given) if x.shape != (function.size1_in(i), kind.members.size)]
            found.append(ca.vec(function.map("of_kind", "serial", kind.members.size, same, [])(*given)))
            continue
        for member in range(kind.members.size):
            one = arguments(kind.coordinates[member : member + 1])
            found.append(function(*one))
    return found


def joined(
    name: str, inputs: Sequence[ca.SX], results: Callable[[Sequence[X]], X], parts: Parts
) -> ca.Function:
    """A function of all contacts: as one graph where they are not `many`."""
    options = {"cse": parts.is_small}
    if parts.contacts.count <= PARAMETERS.many:
        return SizedFunction(name, list(inputs), [results(inputs)], options)
    symbols = [ca.MX.sym(each.name() if each.is_scalar() else "x", each.numel()) for each in inputs]
    return SizedFunction(name, symbols, [results(symbols)])
