"""A CasADi function as a module of LLVM's text: its instructions in their order, and a function for each it calls.

The functions of `lagcli` are graphs (`MXFunction`) of few operations on columns that call lists of operations on
numbers (`SXFunction`); what occurs in neither is refused. Each becomes

    void f(double *argument_0, ..., double *result_0, ...)

of arrays with the entries of the pattern, as in CasADi.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import casadi as ca

from lagcli.native import operations
from lagcli.native.instructions import Body, Index
from lagcli.native.operations import Refusal, literal

Numbers = Sequence[int]

# Bytes that a function may take on the stack, with what it calls: a thread has 512 kB on macOS.
MOST_STACK = 2**18


class Module:
    """A text with the definitions of functions, each made once; others are added to `definitions`."""

    def __init__(self) -> None:
        self.declared: set[str] = set()
        self.definitions: list[str] = []
        self._known: dict[int, tuple[str, ca.Function]] = {}
        self.stack: dict[str, int] = {}  # bytes that each takes, with what it calls

    @property
    def text(self) -> str:
        """The text of the module."""
        return "\n".join([*sorted(self.declared), *self.definitions])

    def named(self, function: ca.Function, name: str = "") -> str:
        """The name of a function, which is defined, under this name or another, if it was not. Raises `Refusal`."""
        key = function.__hash__()
        if key not in self._known:
            # The function is kept: its hash is its address.
            self._known[key] = name, _ = name or f"f{len(self._known)}", function
            body, graph_stack = Body(self.declared), 0
            if function.is_a("SXFunction"):
                _add_numbers(body, function)
            elif function.is_a("MXFunction"):
                graph = _Graph(self, body)
                graph.add(function)
                graph_stack = max((self.stack[called] for called in graph.called), default=0)
            else:
                raise Refusal(function.class_name())
            arguments = [f"ptr noalias readonly %i{k}" for k in range(function.n_in())]
            arguments += [f"ptr noalias %o{k}" for k in range(function.n_out())]
            self.definitions.append(body.definition(name, ", ".join(arguments)))
            self.stack[name] = body.stack + graph_stack
            if self.stack[name] > MOST_STACK:
                raise Refusal(f"{self.stack[name]} bytes of memory")
        return self._known[key][0]


def _add_numbers(body: Body, function: ca.Function) -> None:
    """The operations of an `SXFunction`: every register is a value."""
    registers: dict[int, str] = {}
    for k in range(function.n_instructions()):
        name = operations.NAMES[function.instruction_id(k)]
        out, of = function.instruction_output(k), function.instruction_input(k)
        if name == "OP_CONST":
            registers[out[0]] = literal(function.instruction_constant(k))
        elif name == "OP_INPUT":
            registers[out[0]] = body.load(f"%i{of[0]}", of[1])
        elif name == "OP_OUTPUT":
            body.store(registers[of[0]], f"%o{out[0]}", out[1])
        else:
            registers[out[0]] = operations.scalar(body, name, *(registers[i] for i in of))


class _Graph:
    """The operations of an `MXFunction`: every register is an array with the entries of a pattern.

    CasADi takes a register again once nobody reads what it holds, and reads what an operation does in place entry by
    entry; so a register has one room here too.
    """

    def __init__(self, text: Module, body: Body) -> None:
        self._text, self._body = text, body
        self._at: dict[int, str] = {}
        self._size: dict[int, int] = {}
        self._constant: dict[int, str] = {}  # registers that hold one known number
        self._taken: dict[int, int] = {}  # entries of an argument, or result, that went before
        self._given: dict[int, int] = {}
        self.called: set[str] = set()

    def add(self, function: ca.Function) -> None:
        """All instructions of a function."""
        for k in range(function.n_instructions()):
            name = operations.NAMES[function.instruction_id(k)]
            add = GRAPH_ROWS.get(name, _Graph.entrywise)
            add(
                self,
                name,
                function.instruction_output(k),
                function.instruction_input(k),
                function.instruction_MX(k),
            )

    def argument(self, name: str, out: Numbers, of: Numbers, node: ca.MX) -> None:
        """An argument of the function, or the next part of it, where it stands."""
        begin = self._taken.get(of[0], 0)
        self._taken[of[0]] = begin + node.nnz()
        self._put(out[0], self._body.address(f"%i{of[0]}", begin), node.nnz())

    def result(self, name: str, out: Numbers, of: Numbers, node: ca.MX) -> None:
        """A result of the function, or the next part of it."""
        begin, size = self._given.get(out[0], 0), self._size[of[0]]
        self._given[out[0]] = begin + size
        self._body.copy(self._at[of[0]], self._body.address(f"%o{out[0]}", begin), size)

    def constant(self, name: str, out: Numbers, of: Numbers, node: ca.MX) -> None:
        """Known numbers."""
        numbers = [literal(number) for number in node.to_DM().nonzeros()]
        array = self._new(out[0], len(numbers))
        if len(set(numbers)) == 1:
            self._body.each(len(numbers), lambda i: self._body.store(numbers[0], array, i))
        else:
            for i, number in enumerate(numbers):
                self._body.store(number, array, i)
        if len(numbers) == 1:
            self._constant[out[0]] = numbers[0]

    def call(self, name: str, out: Numbers, of: Numbers, node: ca.MX) -> None:
        """Another function; what is not given is zeros, and what is not wanted is written to nowhere."""
        function = node.which_function()
        called, arrays = self._text.named(function), list[str]()
        self.called.add(called)
        for j, register in enumerate(of):
            if register < 0:
                arrays.append(self._zeros(function.nnz_in(j)))
            else:
                arrays.append(self._at[register])
        for j, register in enumerate(out):
            size = function.nnz_out(j)
            arrays.append(
                self._new(register, size) if register >= 0 else self._body.room(size, f"%nowhere{j}")
            )
        self._body.add(f"call void @{called}({', '.join(f'ptr {array}' for array in arrays)})")

    def _zeros(self, size: int) -> str:
        array = self._body.room(size)
        self._body.each(size, lambda i: self._body.store(literal(0.0), array, i))
        return array

    def joined(self, name: str, out: Numbers, of: Numbers, node: ca.MX) -> None:
        """Columns below one another, or matrices beside one another: their entries after one another."""
        if name == "OP_VERTCAT" and node.size2() != 1:
            raise Refusal(f"{name} of matrices")
        parts = [(self._at[register], self._size[register]) for register in of]
        array, begin = self._new(out[0], node.nnz()), 0
        for part, size in parts:
            self._body.copy(part, self._body.address(array, begin), size)
            begin += size

    def entries(self, name: str, out: Numbers, of: Numbers, node: ca.MX) -> None:
        """Some entries of an array; -1 is a zero."""
        source, places = self._at[of[0]], [int(place) for place in node.mapping().nonzeros()]
        array = self._new(out[0], len(places))
        if places and places[0] >= 0 and all(b - a == 1 for a, b in itertools.pairwise(places)):
            self._body.copy(self._body.address(source, places[0]), array, len(places))
            return
        for i, place in enumerate(places):
            self._body.store(self._body.load(source, place) if place >= 0 else literal(0.0), array, i)

    def other_pattern(self, name: str, out: Numbers, of: Numbers, node: ca.MX) -> None:
        """A matrix with another pattern."""
        source = self._at[of[0]]
        place = {at: i for i, at in enumerate(zip(*node.dep(0).sparsity().get_triplet(), strict=True))}
        array = self._new(out[0], node.nnz())
        for i, at in enumerate(zip(*node.sparsity().get_triplet(), strict=True)):
            self._body.store(self._body.load(source, place[at]) if at in place else literal(0.0), array, i)

    def same_entries(self, name: str, out: Numbers, of: Numbers, node: ca.MX) -> None:
        """Another shape of the same entries."""
        if name == "OP_TRANSPOSE" and 1 not in node.shape:
            raise Refusal(f"{name} of a matrix")
        source, size = self._at[of[0]], self._size[of[0]]
        array = self._new(out[0], size)
        if array != source:
            self._body.copy(source, array, size)

    def extreme(self, name: str, out: Numbers, of: Numbers, node: ca.MX) -> None:
        """The largest or smallest number, of a zero too where the pattern has gaps."""
        operation, worst = {"OP_MMAX": ("OP_FMAX", -math.inf), "OP_MMIN": ("OP_FMIN", math.inf)}[name]
        number = literal(worst if node.dep(0).is_dense() else 0.0)
        for i in range(self._size[of[0]]):
            number = operations.scalar(self._body, operation, number, self._body.load(self._at[of[0]], i))
        self._body.store(number, self._new(out[0], 1), 0)

    def product(self, name: str, out: Numbers, of: Numbers, node: ca.MX) -> None:
        """Z + X Y of full matrices, each sum from the left."""
        X, Y = node.dep(1), node.dep(2)
        if not all(matrix.is_dense() for matrix in (X, Y, node)):
            raise Refusal(f"{name} of sparse matrices")
        z, x, y = (self._at[register] for register in of)
        array, body = self._new(out[0], node.nnz()), self._body
        for column in range(Y.size2()):
            for row in range(X.size1()):
                number = body.load(z, column * X.size1() + row)
                for k in range(X.size2()):
                    factors = body.load(x, k * X.size1() + row), body.load(y, column * X.size2() + k)
                    number = operations.scalar(
                        body, "OP_ADD", number, operations.scalar(body, "OP_MUL", *factors)
                    )
                body.store(number, array, column * X.size1() + row)

    def entrywise(self, name: str, out: Numbers, of: Numbers, node: ca.MX) -> None:
        """An operation on each entry; a single number goes with all entries of the other argument."""
        size = node.nnz()
        if any(self._size[register] not in (1, size) for register in of):
            raise Refusal(f"{name} of arrays of unlike patterns")
        single = [
            self._constant.get(register) or self._body.load(self._at[register], 0)
            if self._size[register] == 1
            else None
            for register in of
        ]
        sources = [self._at[register] for register in of]
        array = self._new(out[0], size)

        def entry(i: Index) -> None:
            numbers = (one or self._body.load(at, i) for one, at in zip(single, sources, strict=True))
            self._body.store(operations.scalar(self._body, name, *numbers), array, i)

        self._body.each(size, entry)

    def _new(self, register: int, size: int) -> str:
        array = self._body.room(size, f"%r{register}")
        self._put(register, array, size)
        return array

    def _put(self, register: int, array: str, size: int) -> None:
        self._at[register], self._size[register] = array, size
        self._constant.pop(register, None)


# What is no operation on each entry.
GRAPH_ROWS: dict[str, Callable[[_Graph, str, Numbers, Numbers, ca.MX], None]] = {
    "OP_INPUT": _Graph.argument,
    "OP_OUTPUT": _Graph.result,
    "OP_CONST": _Graph.constant,
    "OP_CALL": _Graph.call,
    "OP_VERTCAT": _Graph.joined,
    "OP_HORZCAT": _Graph.joined,
    "OP_GETNONZEROS": _Graph.entries,
    "OP_PROJECT": _Graph.other_pattern,
    "OP_RESHAPE": _Graph.same_entries,
    "OP_SPARSITY_CAST": _Graph.same_entries,
    "OP_TRANSPOSE": _Graph.same_entries,
    "OP_MMAX": _Graph.extreme,
    "OP_MMIN": _Graph.extreme,
    "OP_MTIMES": _Graph.product,
}
