"""A CasADi function as a module of LLVM's text: its instructions in their order, and a function for each it calls.

The functions of `lagcli` are graphs (`MXFunction`) of few operations on columns that call lists of operations on
numbers (`SXFunction`); what occurs in neither is refused. Each becomes

    void f(double *argument_0, ..., double *result_0, ..., double *work)

of arrays with the entries of the pattern, as in CasADi, and memory for what is between.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import casadi as ca

from lagcli.native import operations
from lagcli.native.instructions import LANES, Body, Index
from lagcli.native.operations import Refusal, literal
from lagcli.smoothness import operation_graph

Numbers = Sequence[int]

# An `SXFunction` of more operations is written in parts of so many: each operation may have a number on the stack, and
# to make code of long lists takes longer than their length.
LONGEST_WHOLE, PART = 2**14, 2**10
# Operations that wait for the one that reads them are no more than so many.
MOST_WAITING = 64


class Module:
    """A text with the definitions of functions, each made once; others are added to `definitions`. taken: the numbers
    that each takes of its last argument, with what it calls."""

    def __init__(self) -> None:
        self.declared: set[str] = set()
        self.definitions: list[str] = []
        self.taken: dict[str, int] = {}
        self._known: dict[int, tuple[str, ca.Function]] = {}

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
            body, deeper = Body(self.declared), 0
            arguments = [f"ptr noalias readonly %i{k}" for k in range(function.n_in())]
            arguments += [f"ptr noalias %o{k}" for k in range(function.n_out())]
            head = ", ".join([*arguments, "ptr noalias %work"])
            if function.is_a("SXFunction"):
                _Numbers(self, body, function).add(name, head)
            elif function.is_a("MXFunction"):
                graph = _Graph(self, body)
                graph.add(function)
                deeper = max((self.taken[called] for called in graph.called), default=0)
            else:
                raise Refusal(function.class_name())
            self.definitions.append(body.definition(name, head))
            self.taken[name] = body.taken + deeper
        return self._known[key][0]


class _Numbers:
    """The operations of an `SXFunction`: every register is a value, and stands in memory between the parts of a
    function that is no small one. So what a function has on the stack is bounded, and the time that it takes to make
    code of it grows with its length alone."""

    def __init__(self, text: Module, body: Body, function: ca.Function) -> None:
        self._text, self._body, self._function = text, body, function
        self._instructions = operation_graph.instructions(function)
        # The last instruction that reads what each one writes.
        self._last, coming = [0] * len(self._instructions), dict[int, int]()
        for k in reversed(range(len(self._instructions))):
            op, of, out, _ = self._instructions[k]
            if op != ca.OP_OUTPUT:
                self._last[k] = coming.pop(out[0], 0)
            if op != ca.OP_INPUT:
                for register in of:
                    coming.setdefault(register, k)

    def add(self, name: str, head: str) -> None:
        """All instructions of the function of this name, with its arguments as they are written at its head."""
        count = len(self._instructions)
        if count <= LONGEST_WHOLE:
            self._add(self._body, 0, count)
            return
        registers = self._body.room(self._function.sz_w())
        given = ", ".join(each.replace(" noalias", "").replace(" readonly", "") for each in head.split(", "))
        for begin in range(0, count, PART):
            part = Body(self._text.declared)
            self._add(part, begin, min(count, begin + PART))
            self._text.definitions.append(part.definition(f"{name}.{begin}", head))
            self._body.add(f"call void @{name}.{begin}({given.replace('%work', registers)})")

    def _add(self, body: Body, begin: int, end: int) -> None:
        values: dict[int, str] = {}

        def read(register: int) -> str:
            if register not in values:  # an earlier part has written it
                values[register] = body.load("%work", register)
            return values[register]

        for k, (op, of, out, constant) in enumerate(self._instructions[begin:end], start=begin):
            if op == ca.OP_OUTPUT:
                body.store(read(of[0]), f"%o{out[0]}", out[1])
                continue
            if op == ca.OP_CONST:
                value = literal(constant)
            elif op == ca.OP_INPUT:
                value = body.load(f"%i{of[0]}", of[1])
            else:
                value = operations.scalar(body, operations.NAMES[op], *map(read, of))
            values[out[0]] = value
            if self._last[k] >= end:
                body.store(value, "%work", out[0])


class _Array(NamedTuple):
    """Numbers in memory; rooms: the memory of the function that they are in."""

    address: str
    size: int
    rooms: frozenset[str] = frozenset()


class _Number(NamedTuple):
    """One number."""

    value: str
    size: int = 1
    rooms: frozenset[str] = frozenset()


class _Waiting(NamedTuple):
    """An operation on each entry of arrays, which is done in one pass with the one that reads it; length: operations
    in that."""

    name: str
    of: tuple[_Value, ...]
    size: int
    rooms: frozenset[str]
    length: int


_Value = _Array | _Number | _Waiting


class _Graph:
    """The operations of an `MXFunction`: every register is a value with the entries of a pattern.

    What CasADi writes into a register again is another value here. Memory is taken again once no value is in it.
    """

    def __init__(self, text: Module, body: Body) -> None:
        self._text, self._body = text, body
        self._held: dict[int, _Value] = {}
        self._reads: dict[int, int] = {}  # how often each is still read
        self._busy: list[_Value] = []  # what the instruction at hand reads and writes
        self._rooms: dict[str, int] = {}  # with their sizes
        self._taken: dict[int, int] = {}  # entries of an argument, or result, that went before
        self._given: dict[int, int] = {}
        self.called: set[str] = set()

    def add(self, function: ca.Function) -> None:
        """All instructions of a function."""
        count = function.n_instructions()
        outputs = [function.instruction_output(k) for k in range(count)]
        inputs = [function.instruction_input(k) for k in range(count)]
        names = [operations.NAMES[function.instruction_id(k)] for k in range(count)]
        # How often each output is read: looked at from the end.
        reads, coming = [[0]] * count, dict[int, int]()
        for k in reversed(range(count)):
            if names[k] != "OP_OUTPUT":
                reads[k] = [coming.pop(register, 0) for register in outputs[k]]
            if names[k] != "OP_INPUT":
                for register in inputs[k]:
                    coming[register] = coming.get(register, 0) + 1
        for k in range(count):
            self._busy.clear()
            node = function.instruction_MX(k)
            if names[k] == "OP_OUTPUT":
                self._result(outputs[k][0], self._read(inputs[k][0]))
                continue
            values: list[_Value | None]
            if names[k] == "OP_INPUT":
                values = [self._argument(inputs[k][0], node)]
            elif names[k] == "OP_CALL":
                values = self._call(node.which_function(), outputs[k], inputs[k])
            else:
                make = GRAPH_ROWS.get(names[k], _Graph._entrywise)
                values = [make(self, names[k], [self._read(register) for register in inputs[k]], node)]
            for register, value, times in zip(outputs[k], values, reads[k], strict=True):
                if value is not None and times:
                    if isinstance(value, _Waiting) and (times > 1 or value.length > MOST_WAITING):
                        value = self._array(value)
                    self._held[register], self._reads[register] = value, times

    def _read(self, register: int) -> _Value:
        value = self._held[register]
        self._busy.append(value)
        self._reads[register] -= 1
        if not self._reads[register]:
            del self._held[register]
        return value

    def _room(self, size: int) -> _Array:
        """Memory for so many numbers, which no value is in."""
        busy = frozenset[str]().union(*(value.rooms for value in (*self._held.values(), *self._busy)))
        free = [(most, room) for room, most in self._rooms.items() if most >= size and room not in busy]
        if free:
            _, room = min(free)
        else:
            room = self._body.room(size)
            self._rooms[room] = size
        array = _Array(room, size, frozenset([room]))
        self._busy.append(array)
        return array

    def _array(self, value: _Value) -> _Array:
        """A value in memory."""
        if isinstance(value, _Array):
            return value
        array = self._room(value.size)
        self._write(value, array.address)
        return array

    def _number(self, value: _Value) -> str:
        """The number of a value that is one."""
        return value.value if isinstance(value, _Number) else self._body.load(self._array(value).address, 0)

    def _write(self, value: _Value, target: str) -> None:
        """Write all entries of a value; none that it is made of may stand there."""
        body = self._body
        if isinstance(value, _Array):
            body.copy(value.address, target, value.size)
        elif isinstance(value, _Number):
            body.store(value.value, target, 0)
        else:
            is_alike = value.size >= LANES and _is_alike(value)
            numbers = {number: body.everywhere(number) if is_alike else number for number in _numbers(value)}

            def entry(value: _Value, i: Index) -> str:
                if isinstance(value, _Number):
                    return numbers[value.value]
                if isinstance(value, _Array):
                    return body.load(value.address, i)
                return operations.scalar(body, value.name, *(entry(each, i) for each in value.of))

            do = body.some if is_alike else body.each
            do(value.size, lambda i: body.store(entry(value, i), target, i))

    def _argument(self, index: int, node: ca.MX) -> _Value:
        """An argument of the function, or the next part of it, where it stands."""
        begin, size = self._taken.get(index, 0), node.nnz()
        self._taken[index] = begin + size
        if size == 1:
            return _Number(self._body.load(f"%i{index}", begin))
        return _Array(self._body.address(f"%i{index}", begin), size)

    def _result(self, index: int, value: _Value) -> None:
        """A result of the function, or the next part of it."""
        begin = self._given.get(index, 0)
        self._given[index] = begin + value.size
        self._write(value, self._body.address(f"%o{index}", begin))

    def _call(self, function: ca.Function, out: Numbers, of: Numbers) -> list[_Value | None]:
        """Another function; what is not given is zeros, and what is not wanted is written to nowhere."""
        called = self._text.named(function)
        self.called.add(called)
        given = []
        for j, register in enumerate(of):
            if register >= 0:
                given.append(self._array(self._read(register)))
            else:
                given.append(self._full(literal(0.0), function.nnz_in(j)))
        made = [self._room(function.nnz_out(j)) for j in range(len(out))]
        arrays = ", ".join(f"ptr {array.address}" for array in (*given, *made))
        self._body.add(f"call void @{called}({arrays}, ptr %deeper)")
        return [array if register >= 0 else None for register, array in zip(out, made, strict=True)]

    def _full(self, number: str, size: int) -> _Array:
        array = self._room(size)
        self._body.each(size, lambda i: self._body.store(number, array.address, i))
        return array

    def constant(self, name: str, of: Sequence[_Value], node: ca.MX) -> _Value:
        """Known numbers."""
        numbers = [literal(number) for number in node.to_DM().nonzeros()]
        if len(numbers) == 1:
            return _Number(numbers[0])
        if len(set(numbers)) == 1:
            return self._full(numbers[0], len(numbers))
        return self._of_numbers(numbers, len(numbers))

    def _of_numbers(self, numbers: Iterable[str], size: int) -> _Array:
        array = self._room(size)
        for i, number in enumerate(numbers):
            self._body.store(number, array.address, i)
        return array

    def joined(self, name: str, of: Sequence[_Value], node: ca.MX) -> _Value:
        """Columns below one another, or matrices beside one another: their entries after one another."""
        if name == "OP_VERTCAT" and node.size2() != 1:
            raise Refusal(f"{name} of matrices")
        array, begin = self._room(node.nnz()), 0
        for part in of:
            self._write(part, self._body.address(array.address, begin))
            begin += part.size
        return array

    def entries(self, name: str, of: Sequence[_Value], node: ca.MX) -> _Value:
        """Some entries of an array; -1 is a zero."""
        source, places = self._array(of[0]), [int(place) for place in node.mapping().nonzeros()]
        if len(places) > 1 and places[0] >= 0 and all(b - a == 1 for a, b in itertools.pairwise(places)):
            return source._replace(address=self._body.address(source.address, places[0]), size=len(places))
        return self._taken_from(source, places)

    def _taken_from(self, source: _Array, places: Sequence[int]) -> _Value:
        numbers = (self._body.load(source.address, i) if i >= 0 else literal(0.0) for i in places)
        return _Number(next(numbers)) if len(places) == 1 else self._of_numbers(numbers, len(places))

    def other_pattern(self, name: str, of: Sequence[_Value], node: ca.MX) -> _Value:
        """A matrix with another pattern."""
        place = {at: i for i, at in enumerate(zip(*node.dep(0).sparsity().get_triplet(), strict=True))}
        places = [place.get(at, -1) for at in zip(*node.sparsity().get_triplet(), strict=True)]
        return self._taken_from(self._array(of[0]), places)

    def same_entries(self, name: str, of: Sequence[_Value], node: ca.MX) -> _Value:
        """Another shape of the same entries."""
        if name == "OP_TRANSPOSE" and 1 not in node.shape:
            raise Refusal(f"{name} of a matrix")
        return of[0]

    def extreme(self, name: str, of: Sequence[_Value], node: ca.MX) -> _Value:
        """The largest or smallest number, of a zero too where the pattern has gaps."""
        operation, worst = {"OP_MMAX": ("OP_FMAX", -math.inf), "OP_MMIN": ("OP_FMIN", math.inf)}[name]
        number, source = literal(worst if node.dep(0).is_dense() else 0.0), self._array(of[0])
        for i in range(source.size):
            number = operations.scalar(self._body, operation, number, self._body.load(source.address, i))
        return _Number(number)

    def product(self, name: str, of: Sequence[_Value], node: ca.MX) -> _Value:
        """Z + X Y of full matrices, each sum from the left."""
        X, Y = node.dep(1), node.dep(2)
        if not all(matrix.is_dense() for matrix in (X, Y, node)):
            raise Refusal(f"{name} of sparse matrices")
        z, x, y = (self._array(value).address for value in of)
        array, body = self._room(node.nnz()), self._body
        for column in range(Y.size2()):
            for row in range(X.size1()):
                number = body.load(z, column * X.size1() + row)
                for k in range(X.size2()):
                    factors = body.load(x, k * X.size1() + row), body.load(y, column * X.size2() + k)
                    number = operations.scalar(
                        body, "OP_ADD", number, operations.scalar(body, "OP_MUL", *factors)
                    )
                body.store(number, array.address, column * X.size1() + row)
        return array

    def _entrywise(self, name: str, of: Sequence[_Value], node: ca.MX) -> _Value:
        """An operation on each entry; a single number goes with all entries of the other argument."""
        size = node.nnz()
        if any(value.size not in (1, size) for value in of):
            raise Refusal(f"{name} of arrays of unlike patterns")
        of = [_Number(self._number(value)) if value.size == 1 else value for value in of]
        if size == 1:
            return _Number(operations.scalar(self._body, name, *map(self._number, of)))
        rooms = frozenset[str]().union(*(value.rooms for value in of))
        length = 1 + sum(value.length for value in of if isinstance(value, _Waiting))
        return _Waiting(name, tuple(of), size, rooms, length)


def _is_alike(value: _Value) -> bool:
    """True if all operations that wait may be done to some entries at a time."""
    if not isinstance(value, _Waiting):
        return True
    return value.name in operations.ALIKE and all(map(_is_alike, value.of))


def _numbers(value: _Value) -> list[str]:
    """The single numbers that waiting operations read."""
    if isinstance(value, _Waiting):
        return [number for each in value.of for number in _numbers(each)]
    return [value.value] if isinstance(value, _Number) else []


# What is no operation on each entry.
GRAPH_ROWS: dict[str, Callable[[_Graph, str, Sequence[_Value], ca.MX], _Value]] = {
    "OP_CONST": _Graph.constant,
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
