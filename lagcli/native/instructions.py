"""The instructions of one function of LLVM's text, written one after the other.

Numbers are doubles, in values (`%x1`) or in arrays, which are addresses. What is done alike to all entries of arrays is
done to some of them at a time.
"""

from __future__ import annotations

from collections.abc import Callable

# So many entries are done at a time: what each of them becomes does not depend on it.
LANES = 4
DOUBLE, DOUBLES = "double", f"<{LANES} x double>"

Index = int | str


class Body:
    """The instructions of one function, which has memory for `taken` numbers; kind: of the numbers that instructions
    are about just now, one double or some at a time."""

    def __init__(self, declared: set[str]) -> None:
        self._declared = declared
        self._rooms: list[str] = []
        self._lines: list[str] = []
        self._count = 0
        self.taken = 0
        self.kind = DOUBLE

    def definition(self, name: str, arguments: str, first: str = "") -> str:
        """The text of the function; of its arguments, or its first instructions, one is `%work`: memory for what it
        and those that it calls take."""
        head = f"define void @{name}({arguments}) nounwind {{\nentry:{first}"
        rest = f"  %deeper = getelementptr inbounds double, ptr %work, i64 {self.taken}"
        return "\n".join([head, *self._rooms, rest, *self._lines, "  ret void", "}"])

    def add(self, line: str) -> None:
        """An instruction without a result."""
        self._lines.append(f"  {line}")

    def value(self, instruction: str) -> str:
        """See `operations.Lines`."""
        self._count += 1
        self.add(f"%x{self._count} = {instruction}")
        return f"%x{self._count}"

    def called(self, name: str, *arguments: str) -> str:
        """See `operations.Lines`."""
        self._declared.add(
            f"declare double @{name}({', '.join(['double'] * len(arguments))}) nounwind readnone"
        )
        return self.value(f"call double @{name}({', '.join(f'double {a}' for a in arguments)})")

    def room(self, size: int) -> str:
        """The address of memory for so many numbers."""
        room = f"%w{self.taken}"
        self._rooms.append(f"  {room} = getelementptr inbounds double, ptr %work, i64 {self.taken}")
        self.taken += max(1, size)
        return room

    def address(self, array: str, index: Index) -> str:
        """Where a number of an array stands."""
        return array if index == 0 else self.value(f"getelementptr inbounds double, ptr {array}, i64 {index}")

    def load(self, array: str, index: Index) -> str:
        """A number of an array."""
        return self.value(f"load {self.kind}, ptr {self.address(array, index)}, align 8")

    def store(self, number: str, array: str, index: Index) -> None:
        """Write a number of an array."""
        self.add(f"store {self.kind} {number}, ptr {self.address(array, index)}, align 8")

    def everywhere(self, number: str) -> str:
        """A number in all places of those that are done at a time."""
        if not number.startswith("%"):
            return f"<{', '.join([f'double {number}'] * LANES)}>"
        first = self.value(f"insertelement {DOUBLES} poison, double {number}, i64 0")
        return self.value(
            f"shufflevector {DOUBLES} {first}, {DOUBLES} poison, <{LANES} x i32> zeroinitializer"
        )

    def label(self, name: str) -> None:
        """A place to go to, which the instruction before it leads to."""
        self.go(name)
        self._lines.append(f"{name}:")

    def go(self, to: str, label: str | None = None) -> None:
        """Go to a place; the instructions that follow are those of another, if it is named."""
        self.add(f"br label %{to}")
        if label is not None:
            self._lines.append(f"{label}:")

    def go_if(self, predicate: str, a: str, b: str, to: str) -> None:
        """Go to a place if a comparison of two numbers holds (`olt`, `une`, ... of LLVM's fcmp)."""
        is_true = self.value(f"fcmp {predicate} double {a}, {b}")
        self.add(f"br i1 {is_true}, label %{to}, label %else{self._count}")
        self._lines.append(f"else{self._count}:")

    def each(self, size: int, body: Callable[[Index], None]) -> None:
        """Body(i) for i from 0 to size."""
        self._turns(size, 1, body)

    def some(self, size: int, body: Callable[[Index], None]) -> None:
        """Body(i) for entries i, i + 1, ... of `LANES` at a time: the last of them are done again if need be."""
        turns, left = divmod(size, LANES)
        self.kind = DOUBLES
        self._turns(turns, LANES, body)
        if left:
            body(size - LANES)
        self.kind = DOUBLE

    def _turns(self, turns: int, step: int, body: Callable[[Index], None]) -> None:
        if turns <= LANES:  # so few are written out
            for i in range(turns):
                body(i * step)
            return
        self._count += 1
        loop = self._count
        self.label(f"before{loop}")
        self.label(f"loop{loop}")
        self.add(f"%k{loop} = phi i64 [ 0, %before{loop} ], [ %next{loop}, %loop{loop} ]")
        body(f"%k{loop}")
        self.add(f"%next{loop} = add nuw nsw i64 %k{loop}, {step}")
        is_last = self.value(f"icmp eq i64 %next{loop}, {turns * step}")
        self.add(f"br i1 {is_last}, label %after{loop}, label %loop{loop}")
        self._lines.append(f"after{loop}:")

    def copy(self, source: str, target: str, size: int) -> None:
        """Copy so many numbers."""
        do = self.each if size < LANES else self.some
        do(size, lambda i: self.store(self.load(source, i), target, i))
