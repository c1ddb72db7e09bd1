"""The functions of t alone in a model: where it switches, and what may rise and fall within a step. An explicit scheme
sees forces at its stages only: a step that grew while nothing moved may lead over a pulse."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import numpy as np

from lagcli.arrays import Floats, Integers
from lagcli.expression import evaluate, intervals, tree
from lagcli.expression import functions as language
from lagcli.expression.intervals import Range
from lagcli.frozen import frozen_value
from lagcli.memory import Memory
from lagcli.model import model as nouns
from lagcli.smoothness.model_algebra import ModelAlgebra

# Operations on t, values of all of them for the members of families, and operations of any kind in expressions that
# hold t: more are left to the rows of the table.
MOST_OPERATIONS, MOST_VALUES, MOST_STEPS = 1000, 2**14, 20_000
# These only add, shift and scale: they rise and fall where their parts do.
_PLAIN = frozenset(("add", "sub", "neg", "mul"))
# Nor do these bring a pulse about.
_STEADY = _PLAIN | language.named(
    lambda row: row.arguments == 1 and (row.is_piecewise or row.far == "exponential")
)
_FAST = frozenset(("add", "sub", "mul", "div"))
_SWITCHES = language.named(
    lambda row: (
        row.arguments != language.MANY and (row.is_piecewise or row.jumps == "zero" or row.far == "root")
    )
)


@frozen_value
class Operation:
    """A function of earlier values, each by its index or as a number."""

    name: str
    parts: tuple[int | Range, ...]


@frozen_value
class TimeFunctions:
    """Operations on t, which has the index 0, each on those before it.

    size: values of all operations, of a family one for each member; switches: indices of values that are zero where a
    function jumps or has a kink; oscillations: of bounded values that are no sums or products of others; is_mixed:
    whether t stands in a function with coordinates, or functions are too many; cached: what was found out about them.
    """

    operations: tuple[Operation, ...]
    size: int
    switches: tuple[int, ...]
    oscillations: tuple[int, ...]
    is_mixed: bool
    cached: Memory = dataclasses.field(default_factory=Memory, compare=False, repr=False)

    @property
    def is_bounded(self) -> bool:
        """True if every wave has a bound at all times: then nothing can rise and fall that is not looked for."""
        ends = np.array([-np.inf]), np.array([np.inf])
        found = self.values(ends, self.oscillations)
        return all(np.isfinite(a).all() and np.isfinite(b).all() for a, b in found)

    def values(self, cells: Range, wanted: tuple[int, ...]) -> list[Range]:
        """The ranges of the values at these indices over cells of t (low, high), (C,) each, or (K, C) of a family."""
        known: list[Range] = [cells]
        for operation in self.operations[: max(wanted, default=0)]:
            parts = (known[part] if isinstance(part, int) else part for part in operation.parts)
            known.append(intervals.ARRAYS.result(operation.name, *parts))
        return [known[index] for index in wanted]


def functions(model: nouns.Model) -> TimeFunctions | None:
    """The functions of t in everything that moves a model; None where t does not occur there."""
    names, laws, on_particles = _timed(model)
    if not laws and not on_particles:
        return None
    record, discarded = _Record(), _Record(math.inf)
    algebra = _TimeAlgebra(model, names, record)
    meanings = {d.name: d.expression.tree for d in model.definitions}
    # Each after those it uses, so that a chain of any length needs no deep stack.
    for step in model.order:
        if isinstance(step, str):
            algebra.record = record if step in names else discarded
            algebra.known[step] = evaluate.value(meanings[step], algebra)
    algebra.record = record
    for own, group in ((algebra, laws), (algebra.on_a_particle(), on_particles)):
        for law, variables in group:
            own.value(law, variables)
    member_numbers = tuple(record.switches), tuple(record.oscillations)
    return TimeFunctions(tuple(record.operations), record.size, *member_numbers, record.is_mixed)


# An expression with its index variables.
_Laws = list[tuple[tree.Node, Mapping[str, Integers]]]


def _timed(model: nouns.Model) -> tuple[set[str], _Laws, _Laws]:
    """What holds t: the names of definitions and dependent particles, laws, and forces on particles apart."""
    names = {"t"}
    laws: _Laws = []
    on_particles: _Laws = []

    def holds(expression: nouns.Expression) -> bool:
        return not names.isdisjoint(expression.words)

    meanings = {d.name: d.expression for d in model.definitions}
    for step in model.order:
        if isinstance(step, str):
            if holds(meanings[step]):
                names.add(step)
            continue
        particle = model.particles[step.entry]
        parts = [part for part in particle.position.parts if holds(part)]
        if parts:
            names.add(particle.members.base)
            taken = particle.members.taken(step.member_numbers)
            laws += [(part.tree, taken) for part in parts]
    others: list[tuple[nouns.Expression, Mapping[str, Integers]]] = []
    if model.lagrangian is not None:
        others.append((model.lagrangian, {}))
    for force in model.forces:
        variables = force.members.variables
        if isinstance(force, nouns.ParticleForce):
            # A family acts with each of its members somewhere, or nowhere: then a switch of it does no harm.
            on_particles += [(part.tree, variables) for part in force.force.parts if holds(part)]
        else:
            acting = force.expression if isinstance(force, nouns.Potential) else force.force
            others.append((acting, variables))
    others += [(law.equation, law.members.variables) for law in model.laws]
    others += [(event.when, {}) for event in model.events]
    laws += [(expression.tree, variables) for expression, variables in others if holds(expression)]
    return names, laws, on_particles


class _Value:
    """A number, or a function of t at an index; neither where it depends on the motion, `is_timed` on t too."""

    __slots__ = ("index", "is_timed", "number")

    def __init__(self, number: Range | None = None, index: int | None = None, is_timed: bool = False) -> None:
        self.number, self.index, self.is_timed = number, index, is_timed


_MOTION = _Value()
_MOTION_AND_TIME = _Value(is_timed=True)


class _Record:
    """The operations so far, each of them once; most: operations of any kind."""

    def __init__(self, most: float = MOST_STEPS) -> None:
        self._most, self._steps, self.size = most, 0, 1
        self._indices: dict[tuple[object, ...], int] = {}
        self.operations: list[Operation] = []
        self._members: list[int] = [1]
        self._jumps: list[bool] = [False]
        self.switches: dict[int, None] = {}
        self.oscillations: dict[int, None] = {}
        self.is_mixed = False

    def combine(self, name: str, *parts: _Value) -> _Value:
        self._steps += 1
        if self._steps > self._most:
            self.is_mixed = True
            return _MOTION_AND_TIME
        numbers = [part.number for part in parts if part.number is not None]
        if len(numbers) == len(parts):
            if name in _FAST and numbers[0][0].size == numbers[1][0].size == 1:
                # By far the most often.
                (a, b), (c, d) = numbers
                if a is b and c is d and not (name == "div" and float(c) == 0.0):
                    return _Value(number=intervals.constant(language.ARITHMETIC[name](float(a), float(c))))
            return _Value(number=intervals.ARRAYS.result(name, *numbers))
        if any(part.number is None and part.index is None for part in parts):
            # On what depends on the motion. A quotient by what does not depend on both is a product.
            is_timed = any(part.is_timed for part in parts)
            own = parts[1:] if name == "div" else parts
            mixed = any(part.is_timed and part.index is None for part in own)
            if name not in _PLAIN and (mixed or (name != "div" and is_timed)):
                self.is_mixed = True
            return _MOTION_AND_TIME if is_timed else _MOTION
        inputs = [part.number if part.number is not None else part.index for part in parts]
        taken = tuple(part for part in inputs if part is not None)
        members = max(
            self._members[part] if isinstance(part, int) else int(np.size(part[0])) for part in taken
        )
        if len(self.operations) >= MOST_OPERATIONS or self.size + members > MOST_VALUES:
            self.is_mixed = True
            return _MOTION_AND_TIME
        keys = (part if isinstance(part, int) else (part[0].tobytes(), part[1].tobytes()) for part in taken)
        key = (name, *keys)
        if key in self._indices:
            return _Value(index=self._indices[key], is_timed=True)
        self.operations.append(Operation(name, taken))
        self.size += members
        index = self._indices[key] = len(self.operations)
        self._members.append(members)
        jumps = name == "sign" or any(self._jumps[part] for part in taken if isinstance(part, int))
        self._jumps.append(jumps)
        # It rises and falls where its parts do: a sum, a product, a whole power, a quotient by a number.
        last, is_steady = taken[-1], name in _STEADY
        if name in ("div", "pow") and not isinstance(last, int):
            is_steady = name == "div" or bool(((last[0] >= 0.0) & (last[0] == np.round(last[0]))).all())
        if not (is_steady or jumps):
            self.oscillations[index] = None
        return _Value(index=index, is_timed=True)

    def switch(self, value: _Value) -> None:
        """Keep a value whose zeros are kinks or jumps, if it is one of t alone."""
        if value.index is not None:
            self.switches[value.index] = None


class _TimeAlgebra(ModelAlgebra[_Value]):
    """`ModelAlgebra` of these values, with the `record` that operations go into."""

    def __init__(self, model: nouns.Model, timed: set[str], record: _Record) -> None:
        def constant(value: float | Floats) -> _Value:
            return _Value(number=intervals.constant(value))

        super().__init__(model, constant, lambda name: _MOTION_AND_TIME if name in timed else _MOTION)
        self.record = record
        self.known["t"] = _Value(index=0, is_timed=True)

    def special(self, node: tree.Call) -> evaluate.Value[_Value]:
        value = super().special(node)
        if node.function != "d":
            return value
        return evaluate.each(lambda part: _MOTION_AND_TIME if part.is_timed else _MOTION, value)

    def operation(self, node: tree.Node, name: str, *parts: _Value) -> _Value:
        """An operation, with what it switches at, as a divisor or the base of a power that is not whole."""
        record, row = self.record, language.TABLE.get(name)
        if name == "div":
            record.switch(parts[1])
        elif name == "pow":
            least = parts[1].number[0] if parts[1].number is not None else None
            if least is None or not ((least >= 0.0) & (least == np.round(least))).all():
                record.switch(parts[0])
        elif row is not None and row.arguments == language.MANY:
            result = parts[0]
            for argument in parts[1:]:
                record.switch(record.combine("sub", result, argument))
                result = record.combine(name, result, argument)
            return result
        elif row is not None:
            if name in _SWITCHES:
                record.switch(parts[0])
            if row.poles:
                record.switch(record.combine(row.poles, parts[0]))
            for end in row.domain or ():
                record.switch(record.combine("sub", parts[0], _Value(number=intervals.constant(end))))
        return record.combine(name, *parts)
