"""The rows of a model as functions of positions up to the second degree, and roots of one: planes, spheres, cylinders,
distances. Coefficients are numbers, or arrays (T,) over the instants of an animation where they depend on t."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator, Mapping
from typing import TypeVar

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.expression import evaluate, functions, tree
from lagcli.model import model as nouns
from lagcli.model.family import Family, Integers
from lagcli.model.resolve import ModelNames, Resolver

Coefficient = Floats | np.float64  # (T,) or a number
ZERO = np.float64(0)
K = TypeVar("K")

# A page shows no more rows, and a family of all pairs of a thousand particles has half a million.
MOST_ROWS = 20_000


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Quadratic:
    """constant + sum linear_i x_i + sum quadratic_ij x_i x_j (i <= j) + factor sqrt(under).

    x_3k, x_3k+1, x_3k+2 are the components of the position of particle k. known: False for every other function.
    """

    constant: Coefficient = ZERO
    linear: Mapping[int, Coefficient] = dataclasses.field(default_factory=dict)
    quadratic: Mapping[tuple[int, int], Coefficient] = dataclasses.field(default_factory=dict)
    factor: Coefficient = ZERO
    under: Quadratic | None = None
    known: bool = True

    @property
    def is_constant(self) -> bool:
        """True if no position is in it."""
        return self.known and not (self.linear or self.quadratic or self.under)

    @property
    def is_polynomial(self) -> bool:
        """True if there is no root in it."""
        return self.known and self.under is None

    def __neg__(self) -> Quadratic:
        return self.scaled(np.float64(-1.0))

    def __add__(self, other: Quadratic) -> Quadratic:
        if not (self.known and other.known):
            return OTHER
        factor, under = self.factor, self.under or other.under
        if self.under is None:
            factor = other.factor
        elif other.under is not None:
            if other.under is not self.under:
                return OTHER
            factor = factor + other.factor
        return Quadratic(
            self.constant + other.constant,
            _added(self.linear, other.linear),
            _added(self.quadratic, other.quadratic),
            factor,
            under,
        )

    def __sub__(self, other: Quadratic) -> Quadratic:
        return self + -other

    def __mul__(self, other: Quadratic) -> Quadratic:
        if other.is_constant:
            return self.scaled(other.constant)
        if self.is_constant:
            return other.scaled(self.constant)
        are_bare = not any(f.linear or f.quadratic or np.any(f.constant) for f in (self, other))
        if self.under is not None and self.under is other.under and are_bare:
            return self.under.scaled(self.factor * other.factor)
        if not (self.is_polynomial and other.is_polynomial) or self.quadratic or other.quadratic:
            return OTHER
        square: dict[tuple[int, int], Coefficient] = {}
        for (i, a), (j, b) in itertools.product(self.linear.items(), other.linear.items()):
            key = (min(i, j), max(i, j))
            square[key] = square.get(key, ZERO) + a * b
        linear = _added(
            {i: a * other.constant for i, a in self.linear.items()},
            {j: b * self.constant for j, b in other.linear.items()},
        )
        return Quadratic(self.constant * other.constant, linear, _nonzero(square))

    def __truediv__(self, other: Quadratic) -> Quadratic:
        return self.scaled(1.0 / other.constant) if other.is_constant else OTHER

    def scaled(self, by: Coefficient) -> Quadratic:
        """The form times a number."""
        if not self.known:
            return OTHER
        return Quadratic(
            self.constant * by,
            _nonzero({i: a * by for i, a in self.linear.items()}),
            _nonzero({i: a * by for i, a in self.quadratic.items()}),
            self.factor * by,
            self.under,
        )

    @property
    def coefficients(self) -> list[Coefficient]:
        """All of them, of the form under the root too."""
        own = [self.constant, self.factor, *self.linear.values(), *self.quadratic.values()]
        return own if self.under is None else own + self.under.coefficients

    @property
    def is_at_rest(self) -> bool:
        """True if no coefficient depends on t."""
        return not any(np.ndim(part) and np.ptp(part) for part in self.coefficients)

    @property
    def is_finite(self) -> bool:
        """True if every coefficient is finite."""
        return all(bool(np.isfinite(part).all()) for part in self.coefficients)

    @property
    def distance_under_root(self) -> SquareDistance | None:
        """The distance of the form under the root, or None."""
        return distance(self.under, False) if self.under is not None else None

    def values(self, points: Floats) -> Floats:
        """The values (T, k) with the only particle in it at points (T, k, 3); T = 1 for one that is at rest."""
        found = np.zeros(points.shape[:-1]) + _over_points(self.constant)
        for i, a in self.linear.items():
            found = found + _over_points(a) * points[..., i % 3]
        for (i, j), a in self.quadratic.items():
            found = found + _over_points(a) * points[..., i % 3] * points[..., j % 3]
        if self.under is not None:
            found = found + _over_points(self.factor) * np.sqrt(self.under.values(points))
        return np.asarray(found)


OTHER = Quadratic(known=False)


def of_number(value: float | Coefficient) -> Quadratic:
    """A constant."""
    return Quadratic(value if isinstance(value, np.ndarray) else np.float64(value))


def _over_points(value: Coefficient) -> Coefficient:
    """A coefficient as it multiplies values (T, k): a number where it is the same at all instants."""
    numbers = np.asarray(value)
    if not numbers.ndim or not np.ptp(numbers):
        return np.float64(numbers.flat[0])
    return numbers[:, None]


def _added(one: Mapping[K, Coefficient], two: Mapping[K, Coefficient]) -> dict[K, Coefficient]:
    keys = dict.fromkeys((*one, *two))
    return _nonzero({key: one.get(key, ZERO) + two.get(key, ZERO) for key in keys})


def _nonzero(terms: Mapping[K, Coefficient]) -> dict[K, Coefficient]:
    return {key: value for key, value in terms.items() if np.any(value)}


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class SquareDistance:
    """A distance factor (|u|^2 - length^2), u = sum_k weight_k r_k + shift, of all three components or of two.

    weights: of particles by number; shift (3,) or (T, 3); length () or (T,); axes: the components that count; at_most:
    of an inequality, the distance may be less; at_least: it may be more; neither of an equation.
    """

    weights: dict[int, float]
    shift: Floats
    length: Floats
    axes: tuple[int, ...]
    at_most: bool = False
    at_least: bool = False


def squared(form: Quadratic, one_sided: bool) -> tuple[Quadratic, int] | None:
    """The polynomial P with P = 0 where the form is, and the sign of P where an inequality allows it (0 else); None
    where it has no squares, or some that depend on t."""
    polynomial, sign = form, 1
    if form.under is not None:
        if form.linear or form.quadratic or np.ptp(np.sign(form.factor)) or not np.all(form.factor):
            return None
        length = -form.constant / form.factor
        if not np.all(length >= 0):
            return None
        polynomial, sign = form.under - Quadratic(length**2), 1 if np.all(form.factor > 0) else -1
    if not polynomial.quadratic or any(np.ptp(value) for value in polynomial.quadratic.values()):
        return None
    return polynomial, sign if one_sided else 0


def distance(form: Quadratic, one_sided: bool) -> SquareDistance | None:
    """The distance that a row is of, or None."""
    pair = squared(form, one_sided)
    if pair is None:
        return None
    polynomial, sign = pair
    square = {key: float(np.ravel(value)[0]) for key, value in polynomial.quadratic.items()}
    # factor, weights of the particles and components, where the square is factor |sum_k weight_k r_k|^2
    particles = sorted({i // 3 for key in square for i in key})
    axes = tuple(sorted({i % 3 for i, j in square if i == j}))
    if len(axes) < 2 or any(i % 3 != j % 3 for i, j in square):
        return None
    first = particles[0]
    factor = square.get((3 * first + axes[0],) * 2, 0.0)
    if not factor:
        return None
    weights = {first: 1.0}
    for k in particles[1:]:
        weights[k] = square.get((3 * first + axes[0], 3 * k + axes[0]), 0.0) / (2.0 * factor)
    largest = max(map(abs, square.values()))
    for axis, (k, other) in itertools.product(axes, itertools.combinations_with_replacement(particles, 2)):
        wanted = factor * weights[k] * weights[other] * (1.0 if k == other else 2.0)
        if abs(square.get((3 * k + axis, 3 * other + axis), 0.0) - wanted) > doubles.ZERO * largest:
            return None
    # The shift from the linear terms 2 factor weight_k shift . r_k
    linear = polynomial.linear
    if any(i % 3 not in axes or i // 3 not in weights for i in linear):
        return None
    parts = [linear.get(3 * first + axis, ZERO) / (2.0 * factor) for axis in range(3)]
    size = max((float(np.abs(value).max()) for value in linear.values()), default=0.0)
    for (axis, part), (k, weight) in itertools.product(enumerate(parts), weights.items()):
        off = linear.get(3 * k + axis, ZERO) - 2.0 * factor * weight * part
        if np.any(np.abs(off) > doubles.ZERO * size):
            return None
    shift = np.stack(np.broadcast_arrays(*parts), axis=-1)
    inside = (shift**2).sum(axis=-1) - polynomial.constant / factor
    if not np.all(inside >= 0):
        return None
    upper = sign * np.sign(factor)
    return SquareDistance(weights, shift, np.sqrt(inside), axes, bool(upper < 0), bool(upper > 0))


Value = evaluate.Value[Quadratic]


@dataclasses.dataclass(frozen=True, slots=True)
class PicturedRow:
    """A row and what its left side less its right is of the second degree, or `OTHER`; of an inequality `form` >= 0 is
    allowed. law, row: where it stands in the model."""

    name: str
    form: Quadratic
    law: nouns.Holonomic | nouns.Inequality
    row: int

    @property
    def one_sided(self) -> bool:
        """True for an inequality."""
        return isinstance(self.law, nouns.Inequality)


class _QuadraticAlgebra:
    """See `evaluate.Algebra`; what is not of the second degree is `OTHER`."""

    def __init__(self, resolver: Resolver[Quadratic]) -> None:
        self.atom, self._resolver = resolver.atom, resolver

    def special(self, node: tree.Call) -> Value:
        return self._resolver.special(node, self)

    def number(self, node: tree.Number) -> Quadratic:
        return of_number(float(node.text))

    def operation(self, node: tree.Node, name: str, *parts: Quadratic) -> Quadratic:
        base, exponent = parts[0], parts[-1]
        if name == "pow":
            if not exponent.is_constant:
                return OTHER
            if base.is_constant:
                return of_number(base.constant**exponent.constant)
            if np.all(exponent.constant == 2.0):
                return base * base
            if np.all(exponent.constant == 1.0):
                return base
            return self.operation(node, "sqrt", base) if np.all(exponent.constant == 0.5) else OTHER
        if name in functions.ARITHMETIC:
            made: Quadratic = functions.ARITHMETIC[name](*parts)
            return made
        if all(part.is_constant for part in parts):
            return of_number(functions.TABLE[name].array(*(part.constant for part in parts)))
        if name == "sqrt" and base.is_polynomial:
            return Quadratic(factor=np.float64(1.0), under=base)
        return OTHER


class _PositionLeaves:
    """The values of names: times are numbers, positions of particles variables; see `resolve.Leaves`."""

    def __init__(
        self, model: nouns.Model, t: Floats | None, fixed: Mapping[int, Floats] | None = None
    ) -> None:
        """t: None where no time is known; fixed: positions (T, k, 3) of particles that are numbers and no variables."""
        self._names, self._fixed = ModelNames(model), fixed or {}
        self._constants: dict[str, Value] = {"t": OTHER if t is None else of_number(t), "dt": OTHER}
        self._constants |= {name: of_number(value) for name, value in model.constants.items()}
        for parameter in model.parameters:
            if isinstance(parameter.value, tuple):
                x, y, z = map(of_number, parameter.value)
                self._constants[parameter.name] = x, y, z
            else:
                self._constants[parameter.name] = of_number(parameter.value)
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
        return _QuadraticAlgebra(Resolver(self._names, self, numbers, own or {}, lambda *_: OTHER))

    def constant(self, name: str) -> Value | None:
        return self._constants.get(name)

    def position(self, numbers: Integers) -> tuple[Quadratic, Quadratic, Quadratic]:
        number = int(numbers[0])
        if number in self._fixed:
            x, y, z = map(of_number, np.moveaxis(self._fixed[number], -1, 0))
            return x, y, z
        x, y, z = (Quadratic(linear={3 * number + axis: np.float64(1.0)}) for axis in range(3))
        return x, y, z

    def velocity(self, numbers: Integers) -> tuple[Quadratic, Quadratic, Quadratic]:
        return OTHER, OTHER, OTHER

    def generalized(self, numbers: Integers, rates: bool) -> Quadratic:
        return OTHER

    def variable(self, name: str, values: Integers) -> Quadratic:
        return of_number(float(values[0]))

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
            width = _width(law)
            for k in range(min(law.members.count, left // width)):
                forms = evaluate.difference(_relation(law), leaves.algebra(law.members, k))
                names = law.rows[width * k : width * (k + 1)]
                for row, (name, form) in enumerate(zip(names, forms, strict=True), width * k):
                    is_simple = form.known and not form.is_constant and form.is_finite
                    yield PicturedRow(name, form if is_simple else OTHER, law, row)
            left -= width * law.members.count
            if left <= 0:
                return


def _width(law: nouns.Holonomic | nouns.Inequality) -> int:
    """The rows of one member of a law."""
    return len(law.rows) // max(1, law.members.count)


def _relation(law: nouns.Holonomic | nouns.Inequality) -> tree.Relation:
    assert isinstance(law.equation.tree, tree.Relation)
    return law.equation.tree


def value_at(model: nouns.Model, row: PicturedRow, t: Floats | None, particle: int, points: Floats) -> Floats:
    """The values (T, k) of a row at t (T,) with one particle at positions (T, k, 3). nan where the row depends on
    other particles, on coordinates, or, where t is None, on time."""
    law, width = row.law, _width(row.law)
    leaves = _PositionLeaves(model, None if t is None else t[:, None], {particle: points})
    algebra = leaves.algebra(law.members, row.row // width)
    with np.errstate(all="ignore"):
        form = evaluate.difference(_relation(law), algebra)[row.row % width]
    return np.broadcast_to(form.constant if form.is_constant else np.nan, points.shape[:-1])


def summed(model: nouns.Model, t: Floats, row: PicturedRow) -> list[SquareDistance]:
    """The distances whose sum a row limits, each times a number, as of a string over pulleys; none of another row."""
    relation = _relation(row.law)
    if _width(row.law) > 1:  # a row of a vector equation
        return []
    algebra = _PositionLeaves(model, t).algebra(row.law.members, row.row)
    found: list[SquareDistance] = []
    signs = set()
    with np.errstate(all="ignore"):
        for sign, node in (*_addends(relation.left, 1), *_addends(relation.right, -1)):
            form = evaluate.value(node, algebra)
            if isinstance(form, tuple) or not form.known or not form.is_finite:
                return []
            if form.is_constant:
                continue
            part = form.distance_under_root
            if part is None or form.linear or form.quadratic or np.any(part.length):
                return []
            signs |= set(np.sign(np.ravel(sign * form.factor)).tolist())
            found.append(part)
    return found if len(found) > 1 and len(signs) == 1 else []


def _addends(node: tree.Node, sign: int) -> Iterator[tuple[int, tree.Node]]:
    """The terms of a sum, and of the sums in it, with their signs."""
    if not isinstance(node, tree.Sum):
        yield sign, node
        return
    for own, term in node.terms:
        yield from _addends(term, sign * own)


def springs(model: nouns.Model, t: Floats) -> Iterator[tuple[str, SquareDistance]]:
    """The distances at t (T,) whose squares, less a length or not, stand in potentials, with the names of these."""
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
                if form.known and form.is_finite and (found := form.distance_under_root) is not None:
                    yield force.members.names[k], found
        left -= force.members.count


def weight(model: nouns.Model) -> Floats | None:
    """The constant force (3,) that acts on the most particles, on the first of them; None where there is none."""
    leaves = _PositionLeaves(model, None)
    masses = np.concatenate([np.zeros(0), *(np.ravel(p.mass_values) for p in model.particles)])
    forces = [one for one in model.forces if isinstance(one, nouns.ParticleForce) and one.constant]
    force = max(forces, key=lambda one: one.action.targets.size, default=None)
    if force is None or not force.action.targets.size:
        return None
    target, acting = int(force.action.targets[0]), int(force.action.acting[0])
    algebra = leaves.algebra(force.members, acting, {"m": of_number(masses[target])})
    parts = force.force.parts
    if len(parts) == 1:
        found = evaluate.vector(parts[0].tree, algebra)
    else:
        x, y, z = (evaluate.scalar(part.tree, algebra) for part in parts)
        found = x, y, z
    if not all(part.is_constant for part in found):
        return None
    return np.array([float(part.constant) for part in found])
