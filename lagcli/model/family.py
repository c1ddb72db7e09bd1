"""The members of an entry of a model: one thing, or a family of them numbered by indices."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from lagcli.frozen import frozen

Integers = npt.NDArray[np.int64]
Indices = tuple[int, ...]


@frozen
class Family:
    """The K members of an entry: `names` (`p[1][2]`, or a bare name), `indices`, and index variables, (K,) each."""

    base: str
    names: tuple[str, ...]
    indices: tuple[Indices, ...]
    variables: Mapping[str, Integers]  # of rows of joints also numbers that are no indices

    def __repr__(self) -> str:
        return f"<Members of {self.base}: {self.count}>"

    @property
    def count(self) -> int:
        return len(self.names)

    def taken(self, numbers: Integers) -> dict[str, Integers]:
        return {name: values[numbers] for name, values in self.variables.items()}

    def at(self, number: int) -> str:
        """The values of the index variables at a member, such as `i = 3, j = 4`."""
        return ", ".join(f"{name} = {values[number]}" for name, values in self.variables.items())


def one(name: str) -> Family:
    """An entry that is no family."""
    return Family(name, (name,), ((),), {})


def with_indices(base: str, indices: Sequence[Indices], variables: Mapping[str, Integers]) -> Family:
    """The members with these indices."""
    return Family(base, tuple(name(base, index) for index in indices), tuple(indices), variables)


def name(base: str, indices: Iterable[int]) -> str:
    """`p[1][2]`; the bare name of what has no indices."""
    return base + "".join(f"[{i}]" for i in indices)


class MissingMember(LookupError):
    """There is no member of these indices; `position` is the first of several that were looked for."""

    def __init__(self, indices: Indices, position: int) -> None:
        super().__init__(indices)
        self.indices, self.position = indices, position


class MemberIndex:
    """Members of many entries numbered in the order of the file, found by their base name and indices."""

    def __init__(self, entries: Sequence[Family] = ()) -> None:
        self._numbers: dict[str, dict[Indices, int]] = {}
        self._ends: list[int] = []
        self._extremes: dict[str, tuple[Indices, Indices]] = {}
        self.names: list[str] = []
        for entry in entries:
            self.add(entry)

    def __len__(self) -> int:
        return self._ends[-1] if self._ends else 0

    def __contains__(self, base: str) -> bool:
        return base in self._numbers

    def add(self, members: Family) -> str:
        """Number the members of a further entry; the name of the first that is there already, or nothing."""
        known = self._numbers.setdefault(members.base, {})
        first, repeated = len(self), ""
        self._extremes.pop(members.base, None)
        for number, (name, indices) in enumerate(zip(members.names, members.indices, strict=True), first):
            if known.setdefault(indices, number) != number and not repeated:
                repeated = name
        self._ends.append(first + members.count)
        self.names += members.names
        return repeated

    def depth(self, base: str) -> int | None:
        """The number of indices of the members; None where there are none."""
        return next((len(indices) for indices in self._numbers[base]), None)

    def family(self, base: str) -> list[int]:
        return list(self._numbers[base].values())

    def ends(self, base: str) -> tuple[Indices, Indices]:
        """The least and the greatest of the indices there are; there must be some."""
        if base not in self._extremes:
            self._extremes[base] = min(self._numbers[base]), max(self._numbers[base])
        return self._extremes[base]

    def find(self, base: str, indices: Sequence[int | Integers]) -> Integers:
        """The numbers of members: (1,) for numbers, (K,) for index vectors. Raises `MissingMember`."""
        known = self._numbers[base]
        vectors = np.broadcast_arrays(*(np.atleast_1d(i) for i in indices)) if indices else ()
        wanted = list(zip(*(v.tolist() for v in vectors), strict=True)) if indices else [()]
        numbers = np.array([known.get(index, -1) for index in wanted], dtype=np.int64)
        missing = np.flatnonzero(numbers < 0)
        if len(missing):
            position = int(missing[0])
            raise MissingMember(wanted[position], position)
        return numbers

    def entries(self, numbers: Integers) -> Integers:
        return np.searchsorted(np.array(self._ends, dtype=np.int64), numbers, side="right")

    def first(self, entry: int) -> int:
        return self._ends[entry - 1] if entry else 0
