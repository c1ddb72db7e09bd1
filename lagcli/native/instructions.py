"""The instructions of one function of LLVM's text, written one after the other.

Numbers are doubles, in values (`%x1`) or in arrays, which are addresses.
"""

from __future__ import annotations

from collections.abc import Callable

# Loops over so few numbers are written out.
WRITTEN_OUT = 4

Index = int | str


class Body:
    """The instructions of one function."""

    def __init__(self, declared: set[str]) -> None:
        self._declared = declared
        self._rooms: dict[str, int] = {}
        self._lines: list[str] = []
        self._count = 0

    def definition(self, name: str, arguments: str) -> str:
        """The text of the function."""
        head = f"define void @{name}({arguments}) nounwind {{\nentry:"
        rooms = [
            f"  {room} = alloca [{max(size, 1)} x double], align 16" for room, size in self._rooms.items()
        ]
        return "\n".join([head, *rooms, *self._lines, "  ret void", "}"])

    @property
    def stack(self) -> int:
        """The bytes of its rooms."""
        return 8 * sum(self._rooms.values())

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

    def room(self, size: int, name: str | None = None) -> str:
        """The address of memory on the stack for so many numbers, and no fewer than before under a name."""
        name = name or f"%w{len(self._rooms)}"
        self._rooms[name] = max(size, self._rooms.get(name, 0))
        return name

    def address(self, array: str, index: Index) -> str:
        """Where a number of an array stands."""
        return array if index == 0 else self.value(f"getelementptr inbounds double, ptr {array}, i64 {index}")

    def load(self, array: str, index: Index) -> str:
        """A number of an array."""
        return self.value(f"load double, ptr {self.address(array, index)}, align 8")

    def store(self, number: str, array: str, index: Index) -> None:
        """Write a number of an array."""
        self.add(f"store double {number}, ptr {self.address(array, index)}, align 8")

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
        if size <= WRITTEN_OUT:
            for i in range(size):
                body(i)
            return
        self._count += 1
        loop = self._count
        self.label(f"before{loop}")
        self.label(f"loop{loop}")
        self.add(f"%k{loop} = phi i64 [ 0, %before{loop} ], [ %next{loop}, %loop{loop} ]")
        body(f"%k{loop}")
        self.add(f"%next{loop} = add nuw nsw i64 %k{loop}, 1")
        is_last = self.value(f"icmp eq i64 %next{loop}, {size}")
        self.add(f"br i1 {is_last}, label %after{loop}, label %loop{loop}")
        self._lines.append(f"after{loop}:")

    def copy(self, source: str, target: str, size: int) -> None:
        """Copy so many numbers."""
        self.each(size, lambda i: self.store(self.load(source, i), target, i))
