"""The jumps of potentials, of the Lagrangian and of positions of dependent particles: the force there is an impulse.

`3*sign(p.y)` has no slope anywhere but at p.y = 0, where it is infinite; `atan2` has such a point at its cut. Equations
of motion (D.24) see slopes only, so that a run would go over the jump as if there were none.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Protocol

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.equations import jump_search
from lagcli.equations.environment import Environment
from lagcli.equations.family_columns import column
from lagcli.equations.sized_function import SizedFunction
from lagcli.equations.symbols import Symbols
from lagcli.errors import diagnostics
from lagcli.expression import functions
from lagcli.frozen import frozen, frozen_value
from lagcli.model import model as nouns
from lagcli.model.family import Integers

Floats = npt.NDArray[np.float64]
StateValues = jump_search.StateValues

PHRASES = {
    **{row.name: row.edge for row in functions.TABLE.values() if row.jumps},
    jump_search.QUOTIENT: "the divisor of a quotient goes through zero",
}
# A check looks at so many members of a family, evenly spread, and in each subject at so many switches of each word.
MEMBERS, SWITCHES = 16, 32


@frozen
class Subject:
    """A thing that jumps, in words, and where it is declared; value: that of the members of these numbers, (1, 1)."""

    description: str
    location: diagnostics.Location
    count: int
    value: Callable[[Integers], ca.SX]


@frozen_value
class Jump:
    """A jump on a way: the last part before it, what jumps, and the function that makes it jump."""

    part: float
    subject: Subject
    word: str

    @property
    def description(self) -> str:
        """The jump as a clause of a sentence."""
        return f"{self.subject.description} jumps there ({PHRASES[self.word]})"


class Way(Protocol):
    """A way by its part from 0 to 1, with what is known along it."""

    def switches(self, part: float) -> Sequence[float]:
        """`Crossings.switches` there, (K,), until the next call."""

    def values(self, part: float) -> Sequence[float]:
        """`Crossings.values` there, (J,), until the next call."""


@frozen
class Crossings:
    """The K switches of J subjects: words (K,) and owners (K,) by number.

    switches: (t, q, v, p) -> (K,), each changes its sign where its function may jump; values: the subjects (J,).
    """

    subjects: tuple[Subject, ...]
    words: tuple[str, ...]
    owners: tuple[int, ...]
    switches: ca.Function
    values: ca.Function

    def first(self, way: Way, parts: Floats) -> Jump | None:
        """The first jump between neighbouring parts of a way, or None."""
        before = np.sign(way.switches(parts[0]))
        for low, high in itertools.pairwise(parts.tolist()):
            after = np.sign(way.switches(high))
            found = [self._between(k, way, (low, high)) for k in np.flatnonzero(before != after).tolist()]
            jumps = [jump for jump in found if jump is not None]
            if jumps:
                return min(jumps, key=lambda jump: jump.part)
            before = after
        return None

    def _between(self, k: int, way: Way, ends: tuple[float, float]) -> Jump | None:
        low, high = ends
        side = _side(way.switches(low)[k])
        for _ in range(jump_search.PARAMETERS.halvings):
            middle = (low + high) / 2
            if middle in (low, high):
                break
            if _side(way.switches(middle)[k]) == side:
                low = middle
            else:
                high = middle
        offset, owner = jump_search.PARAMETERS.offset, self.owners[k]
        parts = low - 2 * offset, low - offset, high + offset, high + 2 * offset
        values = np.array([way.values(part)[owner] for part in parts])
        return Jump(low, self.subjects[owner], self.words[k]) if jump_search.is_jump(values) else None


def _side(u: float) -> int:
    return (u > 0.0) - (u < 0.0)


class EnergyJumps:
    """The things in a model that may jump: each looked for when it is first asked."""

    def __init__(self, subjects: tuple[Subject, ...], inputs: list[ca.SX]) -> None:
        self._subjects, self._inputs = subjects, inputs

    @cached_property
    def crossings(self) -> Crossings | None:
        """The switches of all members, for a run; None where nothing can change its sign."""
        subjects: list[Subject] = []
        values: list[ca.SX] = []
        found: list[tuple[int, jump_search.Switch]] = []
        for subject in self._subjects:
            value = subject.value(np.arange(subject.count))
            switches = jump_search.switches(value, self._inputs)
            if switches:
                found += [(len(subjects), switch) for switch in switches]
                subjects.append(subject)
                values.append(value)
        if not subjects:
            return None
        arguments = ca.densify(ca.vertcat(*(switch.watched for _, switch in found)))
        return Crossings(
            tuple(subjects),
            tuple(switch.word for _, switch in found),
            tuple(owner for owner, _ in found),
            SizedFunction("switches", self._inputs, [arguments]),
            SizedFunction("values", self._inputs, [ca.densify(ca.vertcat(*values))]),
        )

    def anywhere(self, state: StateValues, p: Floats) -> Iterator[tuple[Subject, str]]:
        """The jumps that are found across switches near a state, with their words, one for each subject at most.

        MEMBERS of a family stand for all of it, for their text is the same, and SWITCHES of each word for all of a
        sum, where some of every shape are taken: what this costs does not grow with their number.
        """
        begin = jump_search.starts(state, p)
        for subject in self._subjects:
            spread = np.linspace(0, subject.count - 1, min(subject.count, MEMBERS))
            value = subject.value(np.unique(spread.round().astype(np.int64)))
            switches = jump_search.examples(jump_search.switches(value, self._inputs), SWITCHES)
            whole = jump_search.Local(value, self._inputs) if switches else None
            for switch in switches:
                if whole is not None and jump_search.jumps(whole, switch.argument, self._inputs, begin):
                    yield subject, switch.word
                    break


def find(model: nouns.Model, s: Symbols, p: ca.SX, env: Environment) -> EnergyJumps:
    """The things in a model that may jump. `p`: all parameters."""
    return EnergyJumps(tuple(_subjects(model, env)), [s.t, s.q, s.v, p])


def _subjects(model: nouns.Model, env: Environment) -> Iterator[Subject]:
    for force in model.forces:
        if isinstance(force, nouns.Potential) and force.members.count:
            description = f"the potential `{force.members.base}`"
            yield Subject(description, force.expression.location, force.members.count, _potential(force, env))
    if model.lagrangian is not None:
        yield Subject("the Lagrangian", model.lagrangian.location, 1, _lagrangian(model.lagrangian, env))
    first = 0
    for particle in model.particles:
        count = particle.members.count
        if particle.is_dependent and count:
            description = f"the position of the particle `{particle.members.base}`"
            yield Subject(description, particle.location, count, _position(first, env))
        first += count


def _potential(force: nouns.Potential, env: Environment) -> Callable[[Integers], ca.SX]:
    def value(numbers: Integers) -> ca.SX:
        found = env.scalar(force.expression, env.algebra(force.members.taken(numbers)))
        return ca.sum1(column(found, numbers.size))

    return value


def _lagrangian(expression: nouns.Expression, env: Environment) -> Callable[[Integers], ca.SX]:
    return lambda numbers: env.scalar(expression)


def _position(first: int, env: Environment) -> Callable[[Integers], ca.SX]:
    def value(numbers: Integers) -> ca.SX:
        # What jumps in one component does so in their sum, with factors that have nothing in common.
        parts = zip((1, 2**0.5, 3**0.5), env.position(first + numbers), strict=True)
        return sum((factor * ca.sum1(part) for factor, part in parts), ca.SX(0))

    return value
