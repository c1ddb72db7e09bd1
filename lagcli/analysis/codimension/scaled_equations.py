"""A part of f = 0, some rows over the coordinates they hold, in coordinates and rows of size one.

A coordinate is measured in the part of its range over which directions of rows change, a row by the length of its
gradient: how clearly numbers show what is definite depends on units.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.linear import metric_rows, rank, surface
from lagcli.linear.metric_rows import LocalRows
from lagcli.start import initial
from lagcli.start.initial import State

Indices = list[int]
IndexArray = npt.NDArray[np.intp]


# Of random directions: a fixed one, so that the verdict does not change.
SEED = 20061


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ScaledPart:
    """Rows of f by their numbers, over the coordinates they hold; x = (q - begin) / unit, F = f / weight.

    unit (m,) of each coordinate, weight (k,) of each row.
    """

    numeric: NumericSystem
    state: State
    rows: Indices
    coordinates: Indices
    unit: Floats
    weight: Floats

    def at(self, z: Floats, t: float) -> tuple[Floats, Floats]:
        """F (k,) and its derivatives (k, m) at x = z."""
        F, rows = self.entries_at(z, t)
        return F, np.array(rows.B)

    def entries_at(self, z: Floats, t: float) -> tuple[Floats, LocalRows]:
        """F (k,) as of `at`, and the derivatives by their entries."""
        f, B = self.numeric.holonomic(t, self.configuration(z), self.state.p)
        rows = LocalRows(B[self.rows, self.coordinates])
        scaled = rows.values * self.unit[rows.column] / self.weight[rows.row]
        return np.array(f).ravel()[self.rows] / self.weight, rows.with_values(scaled)

    def hessian(self, z: Floats, t: float, stress: Floats) -> Floats:
        """Second derivatives (m, m) of stress . F at x = z."""
        found = np.zeros((len(self.coordinates), len(self.coordinates)))
        one, other, values = self.hessian_entries(z, t, stress)
        found[one, other] = values
        return found

    def hessian_entries(self, z: Floats, t: float, stress: Floats) -> tuple[IndexArray, IndexArray, Floats]:
        """The indices and values (e,) of its entries."""
        whole = np.zeros(int(self.numeric.hessian.size1_in(2)))
        whole[self.rows] = stress / self.weight
        H = self.numeric.hessian(t, self.configuration(z), whole, self.state.p)
        found = LocalRows(H[self.coordinates, self.coordinates])
        return found.row, found.column, found.values * self.unit[found.row] * self.unit[found.column]

    @property
    def is_large(self) -> bool:
        """True if the rows are too many to be looked at densely."""
        return metric_rows.are_many(len(self.rows), len(self.coordinates))

    def configuration(self, z: Floats) -> Floats:
        """The configuration q (n,); coordinates without these rows stay where they are."""
        q = self.state.q.copy()
        q[self.coordinates] += self.unit * z
        return q

    def moved(self, z: Floats, t: float) -> ScaledPart:
        """The equations about another point."""
        return dataclasses.replace(self, state=dataclasses.replace(self.state, q=self.configuration(z), t=t))

    @property
    def begin(self) -> Floats:
        """z of the state."""
        return np.zeros(len(self.coordinates))

    @property
    def rounding(self) -> float:
        """The amount by which the rounding of q moves values of F."""
        q = self.state.q[self.coordinates]
        return float(doubles.EPS * np.max(np.abs(q) / self.unit, initial=1.0))


def _second(plain: ScaledPart, J: LocalRows) -> tuple[IndexArray, IndexArray, IndexArray, Floats]:
    """The second derivatives of rows J (k, m) that are not zero: their rows, both coordinates, and sizes, all (z,).
    Rows over other coordinates each are looked at together."""
    k, m = J.count, len(plain.coordinates)
    columns: list[list[int]] = [[] for _ in range(k)]
    for i, j in zip(J.row.tolist(), J.column.tolist(), strict=True):
        columns[i].append(j)
    # Sets of rows that have no coordinate in common, each row in the first that has room for it
    apart: list[Indices] = []
    sets_of: dict[int, set[int]] = {}
    for i, own in enumerate(columns):
        taken = set().union(*(sets_of.get(j, set()) for j in own))
        number = next(n for n in range(len(apart) + 1) if n not in taken)
        if number == len(apart):
            apart.append([])
        apart[number].append(i)
        for j in own:
            sets_of.setdefault(j, set()).add(number)
    indices, sizes = [], []
    for rows in apart:
        chosen, owner = np.zeros(k), np.full(m, -1, dtype=np.intp)
        chosen[rows] = 1.0
        among = chosen[J.row] > 0
        owner[J.column[among]] = J.row[among]
        one, other, values = plain.hessian_entries(plain.begin, plain.state.t, chosen)
        there = np.flatnonzero(values)
        indices.append(np.array([owner[one[there]], one[there], other[there]], dtype=np.intp))
        sizes.append(np.abs(values[there]))
    row, one, other = np.concatenate(indices, axis=1)
    return row, one, other, np.concatenate(sizes)


def part(system: System, numeric: NumericSystem, state: State, rows: Indices) -> ScaledPart:
    """The part of some rows at a state. Units of particles are the extent of their positions, the same for all of them;
    of generalized coordinates such that these move the rows alike, with first and second derivatives."""
    sparse = numeric.holonomic(state.t, state.q, state.p)[1][rows, :]
    coordinates = sorted(set(sparse.sparsity().get_col()))
    B, m, q = LocalRows(sparse[:, coordinates]), len(coordinates), state.q[coordinates]
    plain = ScaledPart(numeric, state, rows, coordinates, np.ones(m), np.ones(len(rows)))
    second_row, one, other, sizes = _second(plain, B)
    first = system.symbols.q.numel() - len(system.model.generalized_names)
    if all(i < first for i in coordinates):
        axes = [[i for i in coordinates if i % 3 == axis] for axis in range(3)]
        extent = max((float(np.ptp(state.q[axis])) for axis in axes if axis), default=0.0)
        unit = np.full(m, extent or initial.size(q))
    else:
        unit = np.full(m, initial.size(q))
        entries = np.concatenate([B.row * m + B.column, second_row * m + one])
        numbers, of_both = np.unique(entries, return_inverse=True)
        row, column = np.divmod(numbers, m)
        of_B, of_second = of_both[: B.row.size], of_both[B.row.size :]
        for _ in range(10):
            size = np.zeros(numbers.size)
            np.add.at(size, of_second, sizes * unit[other])
            size[of_B] = np.maximum(size[of_B], np.abs(B.values))
            size *= unit[column]
            longest, across = np.zeros(B.count), np.zeros(m)
            np.maximum.at(longest, row, size)
            size /= np.where(longest > 0, longest, 1.0)[row]
            np.maximum.at(across, column, size)
            unit = unit / np.sqrt(np.where(across > 0, across, 1.0))
        unit = unit * initial.size(q / unit)
    # Gradients and second derivatives of the rows, and the radius of curvature that the units are made of
    steep = B.with_values(B.values * unit[B.column]).norms
    bent = np.sqrt(np.bincount(second_row, (sizes * unit[one] * unit[other]) ** 2, minlength=B.count))
    with np.errstate(divide="ignore", invalid="ignore"):
        radii = (steep / bent)[steep > rank.PARAMETERS.small * bent]
    radius = float(np.median(radii)) if radii.size else 1.0
    radius = radius if surface.PARAMETERS.shortest < radius < 1.0 else 1.0
    steep, bent = steep * radius, bent * radius**2
    weight = np.where(steep > rank.PARAMETERS.small * bent, steep, bent)
    return dataclasses.replace(plain, unit=unit * radius, weight=np.where(weight > 0, weight, 1.0))


def is_smooth(part: ScaledPart) -> bool:
    """True if the gradient of f changes near the state as second derivatives say: that of |x| jumps."""
    if not part.coordinates:
        return True
    random = np.random.default_rng(SEED)
    mixed, direction = random.standard_normal(len(part.rows)), random.standard_normal(len(part.coordinates))
    z, t = part.begin, part.state.t
    one, other, values = part.hessian_entries(z, t, mixed)
    bend = np.bincount(one, values * direction[other], minlength=direction.size)
    here = part.entries_at(z, t)[1].combined(mixed)
    largest = max(1.0, float(np.abs(values).max(initial=0.0)))
    limit = doubles.ZERO * largest + surface.PARAMETERS.roundings * part.rounding
    for side in (-doubles.ROOT, doubles.ROOT):
        change = part.entries_at(z + side * direction, t)[1].combined(mixed) - here
        if not np.abs(change - side * bend).max(initial=0.0) <= limit:  # nan neither
            return False
    return True
