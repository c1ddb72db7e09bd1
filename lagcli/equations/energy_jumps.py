"""The jumps of potentials, of the Lagrangian and of places of dependent particles: the force there is an impulse.

`3*sign(p.y)` has no slope anywhere but at p.y = 0, where it is infinite; `atan2` has such a place at its cut. Equations
of motion (D.24) see slopes only, so that a run would go over the jump as if there were none.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import re
from collections.abc import Callable, Iterator

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.equations import operation_graph
from lagcli.equations.environment import Environment
from lagcli.equations.family_columns import column
from lagcli.equations.symbols import Symbols
from lagcli.errors import diagnostics
from lagcli.model import model as nouns

Floats = npt.NDArray[np.float64]
# t, q and v on a way; a way by its part from 0 to 1.
Place = tuple[float, Floats, Floats]
Way = Callable[[float], Place]

_WORDS = re.compile(r"\b(sign|atan2?|abs|sqrt|tanh)\s*\(")
QUOTIENT = "a quotient"
_SWITCHES = {
    ca.OP_SIGN: "sign",
    ca.OP_ATAN2: "atan2",
    ca.OP_ATAN: "atan",
    ca.OP_DIV: QUOTIENT,
    ca.OP_INV: QUOTIENT,
}
PHRASES = {
    "sign": "`sign` switches",
    "atan2": "`atan2` crosses its cut",
    "atan": "the argument of `atan` goes through infinity",
    QUOTIENT: "the divisor of a quotient goes through zero",
}
_NEVER_NEGATIVE = frozenset((ca.OP_SQRT, ca.OP_SQ, ca.OP_EXP, ca.OP_FABS))
HALVINGS = 60
# A value jumps where it differs across a switch by so many times what it changes by in the same distance, ASIDE of the
# way, on either side, and by more than its rounding.
ASIDE, ABRUPT, ROUNDED = 1e-9, 10.0, 1e-10
# Places of a switch are sought from so many points, of the size of the start, by so many steps of Newton's method.
POINTS, NEWTON, ON_SWITCH = 12, 30, 1e-9
HINT = "write a force that is steep but finite, as from `tanh(x/w)`, or the torque of an angle as a force"


@dataclasses.dataclass(frozen=True, slots=True)
class Subject:
    """A thing that jumps, in words, and where it is declared."""

    told: str
    location: diagnostics.Location


@dataclasses.dataclass(frozen=True, slots=True)
class Jump:
    """A jump on a way: the last part before it, what jumps, and the function that makes it jump."""

    part: float
    subject: Subject
    word: str

    @property
    def told(self) -> str:
        """It as a clause."""
        return f"{self.subject.told} jumps there ({PHRASES[self.word]})"


@dataclasses.dataclass(frozen=True, slots=True)
class EnergyJumps:
    """The K switches of J subjects: words (K,) and owners (K,) by number.

    switches: (t, q, v, p) -> (K,), each changes its sign where its function may jump; slopes: their gradients (K, n);
    values: the subjects (J,).
    """

    subjects: tuple[Subject, ...]
    words: tuple[str, ...]
    owners: tuple[int, ...]
    switches: ca.Function
    slopes: ca.Function
    values: ca.Function

    def signs(self, place: Place, p: Floats) -> Floats:
        """The side of each switch on which a place lies, (K,)."""
        return np.asarray(np.sign(np.array(self.switches(*place, p)).ravel()))

    def is_crossed(self, way: Way, parts: Floats, p: Floats) -> bool:
        """True if any switch has another sign at one of the parts of a way than at the first."""
        first = self.signs(way(parts[0]), p)
        return any((self.signs(way(part), p) != first).any() for part in parts[1:])

    def first(self, way: Way, parts: Floats, p: Floats) -> Jump | None:
        """The first jump between neighbouring parts of a way, or None."""
        before = self.signs(way(parts[0]), p)
        for low, high in itertools.pairwise(parts):
            after = self.signs(way(high), p)
            found = [self._between(k, way, (low, high), p) for k in np.flatnonzero(before != after).tolist()]
            jumps = [jump for jump in found if jump is not None]
            if jumps:
                return min(jumps, key=lambda jump: jump.part)
            before = after
        return None

    def anywhere(self, place: Place, p: Floats) -> Iterator[Jump]:
        """The jumps that are found across switches near a place, one for each subject at most."""
        t, q, v = place
        random = np.random.default_rng(0)
        size = float(np.abs(q).max(initial=0.0)) or 1.0
        speed = v + (float(np.abs(v).max(initial=0.0)) or 1.0) * random.standard_normal(v.size)
        starts = [q, *(q + size * random.standard_normal((POINTS, q.size)))]
        known: set[int] = set()
        for k, owner in enumerate(self.owners):
            for start in starts if owner not in known else ():
                jump = self._beside(k, (t, start, speed), size, p)
                if jump is not None:
                    known.add(owner)
                    yield jump
                    break

    def _beside(self, k: int, place: Place, size: float, p: Floats) -> Jump | None:
        """A jump across switch k where Newton's method comes upon it from a place."""
        t, q, v = place
        for _ in range(NEWTON):
            value = float(self.switches(t, q, v, p)[k])
            slope = np.array(self.slopes(t, q, v, p))[k]
            square = float(slope @ slope)
            if not (np.isfinite(value) and np.isfinite(square) and square > 0):
                return None
            step = value / square * slope
            q = q - step
            if np.abs(step).max() < ON_SWITCH * size:
                across = size * ASIDE**0.5 * slope / np.sqrt(square)
                return self._between(k, functools.partial(_through, (t, q, v), across), (0.0, 1.0), p)
        return None

    def _between(self, k: int, way: Way, ends: tuple[float, float], p: Floats) -> Jump | None:
        low, high = ends
        sign = self.signs(way(low), p)[k]
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            if self.signs(way(middle), p)[k] == sign:
                low = middle
            else:
                high = middle
        parts = low - 2 * ASIDE, low - ASIDE, high + ASIDE, high + 2 * ASIDE
        a, b, c, d = (float(self.values(*way(part), p)[self.owners[k]]) for part in parts)
        least = max(ABRUPT * max(abs(b - a), abs(d - c)), ROUNDED * max(abs(b), abs(c)))
        return Jump(low, self.subjects[self.owners[k]], self.words[k]) if abs(c - b) > least else None


def _through(centre: Place, across: Floats, part: float) -> Place:
    """A straight way through a place."""
    t, q, v = centre
    return t, q + (2 * part - 1) * across, v


def find(model: nouns.Model, s: Symbols, p: ca.SX, env: Environment) -> EnergyJumps | None:
    """The switches in potentials, Lagrangian and places of a model; None where they have none. `p`: all parameters."""
    if not any(_WORDS.search(text) for text in _texts(model)):
        return None
    subjects: list[Subject] = []
    words: list[str] = []
    owners: list[int] = []
    values, switches = [], []
    inputs = [s.t, s.q, s.v, p]
    for subject, value in _subjects(model, env):
        found = [(word, u) for word, u in _arguments(value, inputs) if ca.depends_on(u, s.q)]
        if found:
            owners += [len(subjects)] * len(found)
            subjects.append(subject)
            values.append(value)
            words += [word for word, _ in found]
            switches += [u for _, u in found]
    if not subjects:
        return None
    u = ca.densify(ca.vertcat(*switches))
    return EnergyJumps(
        tuple(subjects),
        tuple(words),
        tuple(owners),
        ca.Function("switches", inputs, [u]),
        ca.Function("slopes", inputs, [ca.densify(ca.jacobian(u, s.q))]),
        ca.Function("values", inputs, [ca.densify(ca.vertcat(*values))]),
    )


def warnings(jumps: EnergyJumps | None, place: Place, p: Floats) -> tuple[diagnostics.Diagnostic, ...]:
    """One warning for each potential, Lagrangian or place with a jump."""
    if jumps is None:
        return ()
    return tuple(
        diagnostics.Diagnostic(
            "energy-jump",
            f"{jump.subject.told} jumps where {PHRASES[jump.word]}: the force there is an impulse, and a run that gets"
            " there stops",
            jump.subject.location,
            HINT,
            "warning",
        )
        for jump in jumps.anywhere(place, p)
    )


def _subjects(model: nouns.Model, env: Environment) -> Iterator[tuple[Subject, ca.SX]]:
    for force in model.forces:
        if isinstance(force, nouns.Potential) and force.members.count:
            value = env.scalar(force.expression, env.algebra(force.members.variables))
            told = Subject(f"the potential `{force.members.base}`", force.expression.location)
            yield told, ca.sum1(column(value, force.members.count))
    if model.lagrangian is not None:
        yield Subject("the Lagrangian", model.lagrangian.location), env.scalar(model.lagrangian)
    first = 0
    for particle in model.particles:
        numbers = np.arange(particle.members.count) + first
        first += particle.members.count
        if particle.is_dependent and numbers.size:
            # What jumps in one place does so in their sum, with factors that have nothing in common.
            parts = [
                factor * ca.sum1(part)
                for factor, part in zip((1, 2**0.5, 3**0.5), env.position(numbers), strict=True)
            ]
            told = Subject(f"the place of the particle `{particle.members.base}`", particle.location)
            yield told, sum(parts, ca.SX(0))


def _texts(model: nouns.Model) -> Iterator[str]:
    yield from (force.expression.text for force in model.forces if isinstance(force, nouns.Potential))
    if model.lagrangian is not None:
        yield model.lagrangian.text
    yield from (definition.expression.text for definition in model.definitions)
    yield from (part.text for p in model.particles if p.is_dependent for part in p.position.parts)


def _arguments(value: ca.SX, inputs: list[ca.SX]) -> list[tuple[str, ca.SX]]:
    """Functions that may jump, with what changes its sign there, those without another within first."""
    found: list[tuple[str, ca.SX]] = []

    def visit(op: int, parts: list[ca.SX], result: ca.SX) -> ca.SX:
        if op in _SWITCHES:
            argument = parts[1] if op == ca.OP_DIV else parts[0]
            if argument.op() not in _NEVER_NEGATIVE:
                found.append((_SWITCHES[op], argument))
        return result

    operation_graph.replayed(ca.densify(value), inputs, visit)
    return found
