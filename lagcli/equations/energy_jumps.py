"""The jumps of potentials, of the Lagrangian and of positions of dependent particles: `3*sign(p.y)` at p.y = 0, `atan2`
at its cut. The force there is an impulse; equations of motion (D.24) see slopes only, and would go over the jump."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

import casadi as ca
import numpy as np

from lagcli.arrays import Floats, Integers
from lagcli.equations.environment import Environment, column
from lagcli.equations.symbols import Symbols
from lagcli.errors import diagnostics
from lagcli.frozen import frozen, frozen_value
from lagcli.model import model as nouns
from lagcli.smoothness import jump_search, sides, switches
from lagcli.smoothness.sized_function import SizedFunction

StateValues = jump_search.StateValues

PHRASES = switches.PHRASES | {switches.QUOTIENT: "the divisor of a quotient goes through zero"}


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
    """The K switches of J subjects: words (K,) and owners (K,) by number. switches: (t, q, v, p) -> (K,), each changes
    its sign where its function may jump; values: the subjects (J,)."""

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
            found = []
            for k in np.flatnonzero(before != after).tolist():

                def is_before(part: Floats, k: int = k, side: float = before[k]) -> bool:
                    return bool(np.sign(way.switches(float(part))[k]) == side)

                ends, owner = sides.bracket(is_before, low, high), self.owners[k]
                values = tuple(np.array(way.values(float(part))[owner]) for part in sides.beside(*ends))
                if sides.value_jumps(values):
                    found.append(Jump(float(ends[0]), self.subjects[owner], self.words[k]))
            if found:
                return min(found, key=lambda jump: jump.part)
            before = after
        return None


class EnergyJumps:
    """The things in a model that may jump: each looked for when it is first asked. p: all parameters."""

    def __init__(self, model: nouns.Model, s: Symbols, p: ca.SX, env: Environment) -> None:
        self._subjects, self._inputs = tuple(_subjects(model, env)), [s.t, s.q, s.v, p]

    @functools.cached_property
    def crossings(self) -> Crossings | None:
        """The switches of all members, for a run; None where nothing can change its sign."""
        subjects: list[Subject] = []
        values: list[ca.SX] = []
        found: list[tuple[int, jump_search.Jumping]] = []
        for subject in self._subjects:
            value = subject.value(np.arange(subject.count))
            jumping = jump_search.switches(value, self._inputs)
            if jumping:
                found += [(len(subjects), switch) for switch in jumping]
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
        """The jumps that are found across switches near a state, with their words, one for each subject at most."""
        for subject in self._subjects:
            value = subject.value(jump_search.spread(subject.count))
            word = jump_search.word(value, self._inputs, (state, p))
            if word is not None:
                yield subject, word


def _subjects(model: nouns.Model, env: Environment) -> Iterator[Subject]:
    for force in model.forces:
        if isinstance(force, nouns.Potential) and force.members.count:
            description = f"the potential `{force.members.base}`"
            value = functools.partial(_potential, force, env)
            yield Subject(description, force.expression.location, force.members.count, value)
    if model.lagrangian is not None:
        expression = model.lagrangian
        yield Subject("the Lagrangian", expression.location, 1, lambda numbers: env.scalar(expression))
    first = 0
    for particle in model.particles:
        count = particle.members.count
        if particle.is_dependent and count:
            description = f"the position of the particle `{particle.members.base}`"
            yield Subject(description, particle.location, count, functools.partial(_position, first, env))
        first += count


def _potential(force: nouns.Potential, env: Environment, numbers: Integers) -> ca.SX:
    found = env.scalar(force.expression, env.algebra(force.members.taken(numbers)))
    return ca.sum1(column(found, numbers.size))


def _position(first: int, env: Environment, numbers: Integers) -> ca.SX:
    # What jumps in one component does so in their sum, with factors that have nothing in common.
    parts = zip((1, 2**0.5, 3**0.5), env.position(first + numbers), strict=True)
    return sum((factor * ca.sum1(part) for factor, part in parts), ca.SX(0))
