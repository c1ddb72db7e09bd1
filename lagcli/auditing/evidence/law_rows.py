"""The rows of a model as values on a table: where each stands among all, and f beyond the cut of an angle.

Holonomic rows come first, then those of rigid bodies, then inequalities that are closed, then differential rows.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from lagcli.auditing.evidence import model_values
from lagcli.auditing.evidence.autodiff import Array, Scalar, Triple
from lagcli.auditing.evidence.model_values import ModelIndex, ModelOnTable
from lagcli.equations import rigid
from lagcli.expression import evaluate, tree
from lagcli.model import model as nouns
from lagcli.model.family import Integers

SPOT = tree.Node(0, 0)
# Turns of all angles but one that are tried where a row has several: what no motion satisfies stays above its limit,
# as no more than some thousand values are compared. With 100 or 10 000 for two angles
# `test_turns_of_two_angles_are_taken_out_up_to_a_thousand` of `tests/unit/test_numbers_of_the_audit.py` fails.
MOST_TURNS = {1: 0, 2: 1000, 3: 20}

RowValues = list[tuple[Scalar, Integers]]
"""Values of rows with their indices among all rows."""


def build(
    on_table: ModelOnTable,
    bodies: Sequence[rigid.Geometry],
    closed: Sequence[tuple[nouns.Inequality, Integers]],
) -> tuple[RowValues, RowValues]:
    """The holonomic and the differential rows; bodies: of `geometries`, closed: of `members`."""
    model = on_table.index.model
    surfaces: RowValues = []
    laws: RowValues = []
    first = 0
    for holonomic in model.holonomic:
        first = _add_rows(on_table, holonomic, surfaces, first)
    for body, geometry in zip(model.rigid, bodies, strict=True):
        numbers = np.array(body.particles, dtype=np.int64)
        for x, offsets in _rigid_rows(on_table, numbers, geometry):
            surfaces.append((x, first + offsets))
        first += len(geometry.pairs) + 3 * len(geometry.further)
    for inequality, members in closed:
        assert isinstance(inequality.equation.tree, tree.Relation)
        algebra = on_table.algebra(inequality.members.taken(members))
        surfaces.append(
            (evaluate.difference(inequality.equation.tree, algebra)[0], first + np.arange(members.size))
        )
        first += members.size
    for differential in model.differential:
        first = _add_rows(on_table, differential, laws, first)
    return surfaces, laws


def geometries(index: ModelIndex) -> tuple[rigid.Geometry, ...]:
    """The geometry of each rigid body at the declared start."""
    t, q, v = model_values.start(index.model)
    on_table = ModelOnTable(index, np.full((1, 1), t), q[None, :], v[None, :])
    by_body = []
    for body in index.model.rigid:
        numbers = np.array(body.particles, dtype=np.int64)
        parts = on_table.position(numbers)
        by_body.append(rigid.geometry(np.stack([on_table.wide(p, numbers.size)[0] for p in parts], axis=1)))
    return tuple(by_body)


def _add_rows(
    on_table: ModelOnTable,
    law: nouns.Holonomic | nouns.Differential,
    into: RowValues,
    first: int,
) -> int:
    """Add the rows of a law, left - right; those of one member stand together. The number of rows so far."""
    if not law.members.count:
        return first
    assert isinstance(law.equation.tree, tree.Relation)
    parts = evaluate.difference(law.equation.tree, on_table.algebra(law.members.variables))
    members = np.arange(law.members.count, dtype=np.int64)
    for axis, part in enumerate(parts):
        into.append((part, first + len(parts) * members + axis))
    return first + len(parts) * law.members.count


def members(
    laws: Sequence[nouns.Inequality], numbers: Integers
) -> Iterator[tuple[nouns.Inequality, Integers]]:
    """The inequalities with those of their members that are among these numbers of all."""
    first = 0
    for law in laws:
        count = law.members.count
        own = numbers[(numbers >= first) & (numbers < first + count)] - first
        if own.size:
            yield law, own
        first += count


def _rigid_rows(
    on_table: ModelOnTable, numbers: Integers, geometry: rigid.Geometry
) -> Iterator[tuple[Scalar, Integers]]:
    """The rows of a rigid body: distances of the base, then each further particle by its coefficients."""
    a, base = on_table.algebra(), numbers[list(geometry.base)]

    def minus(left: Triple, right: Triple) -> list[Scalar]:
        return [a.add(SPOT, u, -1, w) for u, w in zip(left, right, strict=True)]

    def point(j: int) -> Triple:
        return on_table.position(base[j : j + 1])

    if geometry.pairs:
        one, other = (base[[pair[side] for pair in geometry.pairs]] for side in (0, 1))
        square: Scalar = np.zeros((1, 1))
        for part in minus(on_table.position(one), on_table.position(other)):
            square = a.add(SPOT, square, 1, a.multiply(SPOT, part, part))
        distances = np.array(geometry.distances)[None, :]
        yield a.add(SPOT, a.function(SPOT, "sqrt", (square,)), -1, distances), np.arange(len(geometry.pairs))
    if not geometry.further:
        return
    further = on_table.position(numbers[list(geometry.further)])
    normal: list[Scalar] = [np.zeros((1, 1))] * 3
    if geometry.gamma.size:
        (p, q, r), (x, y, z) = minus(point(1), point(0)), minus(point(2), point(0))
        for axis, (c, d, e, f) in enumerate(((q, z, r, y), (r, x, p, z), (p, y, q, x))):
            minor = a.add(SPOT, a.multiply(SPOT, c, d), -1, a.multiply(SPOT, e, f))
            normal[axis] = a.multiply(SPOT, minor, geometry.gamma[None, :])
    indices = len(geometry.pairs) + 3 * np.arange(len(geometry.further))
    for axis in range(3):
        row = a.add(SPOT, further[axis], -1, normal[axis])
        for j in range(len(geometry.base)):
            row = a.add(SPOT, row, -1, a.multiply(SPOT, point(j)[axis], geometry.alpha[None, :, j]))
        yield row, indices + axis


def reduced(f: Array, jumps: Mapping[int, tuple[float, ...]]) -> None:
    """Take the whole turns of angles out of f (T, s), in place. jumps: the constants of each row, by its number.

    A run goes on smoothly beyond the cut of `atan2` or `atan`, so that f differs from what the file says by whole
    numbers of the constants by which one turn of each angle changes it. They are given: nothing here knows the solver.
    """
    for row, (size, *others) in jumps.items():
        if 1 + len(others) not in MOST_TURNS:
            continue
        x = f[:, row].real
        best = x - size * np.round(x / size)
        most = MOST_TURNS[1 + len(others)]
        for turns in itertools.product(range(-most, most + 1), repeat=len(others)):
            rest = x - sum(k * other for k, other in zip(turns, others, strict=True))
            rest = rest - size * np.round(rest / size)
            best = np.where(np.abs(rest) < np.abs(best), rest, best)
        f[:, row] += best - x
