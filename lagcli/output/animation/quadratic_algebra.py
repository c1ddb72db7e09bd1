"""The rows of a model as functions of the second degree in positions, over the instants of an animation."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import Literal

import numpy as np
import numpy.typing as npt

from lagcli.expression import evaluate, functions, tree
from lagcli.expression.evaluate import Operators
from lagcli.model import model as nouns
from lagcli.model.family import Family, Integers
from lagcli.model.resolve import ModelNames, Reference, Resolver
from lagcli.output.animation import quadratic_form
from lagcli.output.animation.quadratic_form import OTHER, Quadratic, SquareDistance

Floats = npt.NDArray[np.float64]
Value = evaluate.Value[Quadratic]

# A page shows no more, and a family of all pairs of a thousand particles has half a million rows.
MOST_ROWS = 20_000


@dataclasses.dataclass(frozen=True, slots=True)
class PicturedRow:
    """A row and what its left side less its right is of the second degree, or `OTHER`; of an inequality `form` >= 0 is
    allowed. law, row: where it stands in the model."""

    name: str
    kind: Literal["holonomic", "inequality"]
    form: Quadratic
    law: nouns.Holonomic | nouns.Inequality
    row: int


@dataclasses.dataclass(frozen=True, slots=True)
class SpringLength:
    """A distance whose square, or that of how far it is off a length, stands in a potential."""

    name: str
    distance: SquareDistance


class _QuadraticAlgebra(Operators):
    """See `evaluate.Algebra`; what is not of the second degree is `OTHER`."""

    def __init__(
        self, atom: Callable[[Reference], Value], special: Callable[[tree.Call, _QuadraticAlgebra], Value]
    ) -> None:
        self.atom, self._special = atom, special

    def special(self, node: tree.Call) -> Value:
        return self._special(node, self)

    def number(self, node: tree.Number) -> Quadratic:
        return quadratic_form.number(float(node.text))

    def power(self, node: tree.Node, base: Quadratic, exponent: Quadratic) -> Quadratic:
        if not exponent.is_constant:
            return OTHER
        if base.is_constant:
            return quadratic_form.number(base.constant**exponent.constant)
        if np.all(exponent.constant == 2.0):
            return base * base
        if np.all(exponent.constant == 1.0):
            return base
        return self.function(node, "sqrt", (base,)) if np.all(exponent.constant == 0.5) else OTHER

    def function(self, node: tree.Node, name: str, arguments: tuple[Quadratic, ...]) -> Quadratic:
        if all(argument.is_constant for argument in arguments):
            values = [argument.constant for argument in arguments]
            return quadratic_form.number(functions.TABLE[name].array(*values))
        if name == "sqrt" and arguments[0].is_polynomial:
            return Quadratic(factor=np.float64(1.0), under=arguments[0])
        return OTHER


class _PositionLeaves:
    """The values of names: times are numbers, positions of particles variables; see `resolve.Leaves`."""

    def __init__(
        self, model: nouns.Model, t: Floats | None, fixed: Mapping[int, Floats] | None = None
    ) -> None:
        """t: None where no time is known; fixed: positions (T, k, 3) of particles that are numbers and no variables."""
        self._names, self._fixed = ModelNames(model), fixed or {}
        self._constants: dict[str, Value] = {
            "t": OTHER if t is None else quadratic_form.number(t),
            "dt": OTHER,
        }
        self._constants |= {name: quadratic_form.number(value) for name, value in model.constants.items()}
        for parameter in model.parameters:
            if isinstance(parameter.value, tuple):
                x, y, z = map(quadratic_form.number, parameter.value)
                self._constants[parameter.name] = x, y, z
            else:
                self._constants[parameter.name] = quadratic_form.number(parameter.value)
        self._definitions: dict[str, Value] = {}
        for name in model.order:
            if isinstance(name, str):
                self.definition(name)

    def algebra(
        self, members: Family | None = None, k: int = 0, own: Mapping[str, Value] | None = None
    ) -> _QuadraticAlgebra:
        """The algebra for the member `k` of a family, with its variables; `own`: more names."""
        variables = members.variables if members is not None else {}
        numbers = {name: values[k : k + 1] for name, values in variables.items()}
        resolver = Resolver(self._names, self, numbers, own or {}, lambda *_: OTHER)
        return _QuadraticAlgebra(resolver.atom, resolver.special)

    def constant(self, name: str) -> Value | None:
        return self._constants.get(name)

    def position(self, numbers: Integers) -> tuple[Quadratic, Quadratic, Quadratic]:
        number = int(numbers[0])
        if number in self._fixed:
            x, y, z = map(quadratic_form.number, np.moveaxis(self._fixed[number], -1, 0))
            return x, y, z
        x, y, z = (Quadratic(linear={3 * number + axis: np.float64(1.0)}) for axis in range(3))
        return x, y, z

    def velocity(self, numbers: Integers) -> tuple[Quadratic, Quadratic, Quadratic]:
        return OTHER, OTHER, OTHER

    def generalized(self, numbers: Integers, rates: bool) -> Quadratic:
        return OTHER

    def variable(self, name: str, values: Integers) -> Quadratic:
        return quadratic_form.number(float(values[0]))

    def definition(self, name: str) -> Value:
        if name not in self._definitions:
            self._definitions[name] = evaluate.value(self._names.definitions[name], self.algebra())
        return self._definitions[name]

    def differential(self, value: Quadratic) -> Quadratic:
        return OTHER


def rows(model: nouns.Model, t: Floats) -> Iterator[PicturedRow]:
    """The rows over the instants t (T,), in the order of the model, `MOST_ROWS` at most."""
    leaves, left = _PositionLeaves(model, t), MOST_ROWS
    laws: tuple[nouns.Holonomic | nouns.Inequality, ...] = (*model.holonomic, *model.inequality)
    with np.errstate(all="ignore"):
        for law in laws:
            kind: Literal["holonomic", "inequality"] = (
                "holonomic" if isinstance(law, nouns.Holonomic) else "inequality"
            )
            assert isinstance(law.equation.tree, tree.Relation)
            width = len(law.rows) // max(1, law.members.count)
            for k in range(min(law.members.count, left // width)):
                forms = evaluate.difference(law.equation.tree, leaves.algebra(law.members, k))
                names = law.rows[width * k : width * (k + 1)]
                for row, (name, form) in enumerate(zip(names, forms, strict=True), width * k):
                    simple = form.known and not form.is_constant and _is_finite(form)
                    yield PicturedRow(name, kind, form if simple else OTHER, law, row)
            left -= width * law.members.count
            if left <= 0:
                return


def value_at(
    model: nouns.Model, row: PicturedRow, t: Floats | None, particle: int, points: Floats
) -> Floats | None:
    """The values (T, k) of a row at t (T,) with one particle at positions (T, k, 3). None where the row depends on
    other particles, on coordinates, or, where t is None, on time."""
    law = row.law
    leaves = _PositionLeaves(model, None if t is None else t[:, None], {particle: points})
    assert isinstance(law.equation.tree, tree.Relation)
    width = len(law.rows) // max(1, law.members.count)
    algebra = leaves.algebra(law.members, row.row // width)
    with np.errstate(all="ignore"):
        form = evaluate.difference(law.equation.tree, algebra)[row.row % width]
    return np.broadcast_to(form.constant, points.shape[:-1]) if form.is_constant else None


def summed(model: nouns.Model, t: Floats, row: PicturedRow) -> list[SquareDistance]:
    """The distances whose sum a row limits, each times a number, as of a string over pulleys; none of another row."""
    law = row.law
    relation = law.equation.tree
    assert isinstance(relation, tree.Relation)
    if len(law.rows) != law.members.count:  # a row of a vector equation
        return []
    algebra = _PositionLeaves(model, t).algebra(law.members, row.row)
    found: list[SquareDistance] = []
    signs = set()
    with np.errstate(all="ignore"):
        for sign, node in (*_addends(relation.left, 1), *_addends(relation.right, -1)):
            form = evaluate.value(node, algebra)
            if isinstance(form, tuple) or not form.known or not _is_finite(form):
                return []
            if form.is_constant:
                continue
            distance = quadratic_form.distance(form.under, False) if form.under is not None else None
            if distance is None or form.linear or form.quadratic or np.any(distance.length):
                return []
            signs |= set(np.sign(np.ravel(sign * form.factor)).tolist())
            found.append(distance)
    return found if len(found) > 1 and len(signs) == 1 else []


def _addends(node: tree.Node, sign: int) -> Iterator[tuple[int, tree.Node]]:
    """The terms of a sum, and of the sums in it, with their signs."""
    if not isinstance(node, tree.Sum):
        yield sign, node
        return
    for own, term in node.terms:
        yield from _addends(term, sign * own)


def springs(model: nouns.Model, t: Floats) -> Iterator[SpringLength]:
    """The distances between points whose squares stand in potentials, at the instants t (T,)."""
    leaves, left = _PositionLeaves(model, t), MOST_ROWS
    for force in model.forces:
        if not isinstance(force, nouns.Potential):
            continue
        calls = [
            call
            for square in tree.walk(force.expression.tree)
            if isinstance(square, tree.Power) and isinstance(square.exponent, tree.Number)
            if float(square.exponent.text) == 2.0
            for call in tree.walk(square)
            if isinstance(call, tree.Call) and call.function in ("distance", "norm")
        ]
        for k in range(min(force.members.count, left)):
            for call in calls:
                with np.errstate(all="ignore"):
                    form = evaluate.scalar(call, leaves.algebra(force.members, k))
                if form.known and form.under is not None and _is_finite(form):
                    found = quadratic_form.distance(form.under, False)
                    if found is not None:
                        yield SpringLength(force.members.names[k], found)
        left -= force.members.count


def weight(model: nouns.Model) -> Floats | None:
    """The constant force (3,) that acts on the most particles, on the first of them; None where there is none."""
    leaves = _PositionLeaves(model, None)
    masses = np.concatenate([np.zeros(0), *(np.ravel(p.mass_values) for p in model.particles)])
    constant = [one for one in model.forces if isinstance(one, nouns.ParticleForce) and one.constant]
    constant = [one for one in constant if one.action.targets.size]
    if not constant:
        return None
    force = max(constant, key=lambda one: one.action.targets.size)
    target, acting = int(force.action.targets[0]), int(force.action.acting[0])
    algebra = leaves.algebra(force.members, acting, {"m": quadratic_form.number(masses[target])})
    parts = force.force.parts
    if len(parts) == 1:
        found = evaluate.vector(parts[0].tree, algebra)
    else:
        x, y, z = (evaluate.scalar(part.tree, algebra) for part in parts)
        found = x, y, z
    if not all(part.is_constant for part in found):
        return None
    return np.array([float(part.constant) for part in found])


def _is_finite(form: Quadratic) -> bool:
    return all(bool(np.isfinite(part).all()) for part in form.coefficients)
