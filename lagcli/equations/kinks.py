"""The points at which `abs`, `sign`, `min` or `max` makes the gradient of a constraint jump: edges of its surface,
where the rule of multipliers has no gradient, and the velocity of a motion over the edge would have to jump."""

from __future__ import annotations

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.equations.rows import ConstraintRows, Row
from lagcli.equations.symbols import Symbols
from lagcli.errors import diagnostics
from lagcli.frozen import frozen
from lagcli.smoothness import sides, switches
from lagcli.smoothness.sized_function import SizedFunction

Indices = npt.NDArray[np.intp]


def coordinate_sizes(q: Floats, numbers: Indices, columns: Indices, count: int) -> Floats:
    """How large the coordinates of a row are, (n,): of the one with the smallest, of those that hold a coordinate.
    numbers, columns (E,): which of `count` rows hold which coordinates."""
    size = float(np.abs(q).max(initial=0.0)) or 1.0
    of_rows, of_coordinates = np.zeros(count), np.full(q.size, size)
    np.maximum.at(of_rows, numbers, np.abs(q)[columns])
    np.minimum.at(of_coordinates, columns, np.where(of_rows > 0.0, of_rows, size)[numbers])
    return of_coordinates


@frozen
class Kinks:
    """The K rows that switch; slopes: (t, q, p) -> their B, b and f (K, n + 2), b at rest, f zero where a row is
    differential; entries: numbers of rows and of the coordinates that their slopes hold, (E,) each; gradients:
    (t, q, p) -> those by q of what is compared with zero (A, n), sparse."""

    rows: tuple[Row, ...]
    slopes: ca.Function
    entries: tuple[Indices, Indices]
    gradients: ca.Function

    def at(self, t: float, q: Floats, p: Floats) -> Row | None:
        """A row that jumps at a configuration, itself or its gradient, or None."""
        sizes = coordinate_sizes(q, *self.entries, len(self.rows))
        # A switch is near by the rounding of its terms: v + 1000 x moves by no more than a part of the larger of them.
        gradients = self.gradients(t, q, p)
        numbers, columns = (np.array(part, dtype=np.intp) for part in gradients.sparsity().get_triplet())
        steep = np.abs(np.array(gradients.nonzeros(), dtype=float))
        terms, flattest = np.zeros(gradients.size1()), np.full(gradients.size1(), np.inf)
        np.maximum.at(terms, numbers, steep * np.abs(q)[columns])
        np.minimum.at(flattest, numbers, np.where(steep > 0.0, steep * sizes[columns], np.inf))
        with np.errstate(divide="ignore", invalid="ignore"):
            np.fmin.at(sizes, columns, np.maximum(terms, flattest)[numbers] / steep)
        way = np.random.default_rng(0).standard_normal(q.size) * sizes

        def slopes(q: Floats) -> Floats:
            return np.array(self.slopes(t, q, p)).reshape(len(self.rows), -1)

        here = slopes(q)
        # What draws near as the distance shrinks is no jump.
        near, far = (
            np.abs(slopes(q + h * way) - slopes(q - h * way)).max(axis=1, initial=0.0)
            for h in (doubles.ZERO, doubles.STEP)
        )
        least = doubles.ROOT * (np.abs(here).max(axis=1, initial=0.0) + far)
        jumps = np.isfinite(here).all(axis=1) & sides.differ(near, far, least)
        return self.rows[int(np.argmax(jumps))] if jumps.any() else None

    def require_smooth(self, t: float, q: Floats, p: Floats) -> None:
        """Raise `diagnostics.ModelError` where the gradient of a row jumps at the start."""
        row = self.at(t, q, p)
        if row is not None:
            message = (
                f"the gradient of the constraint `{row.name}` jumps at the start, to nine digits: `abs`, `sign`,"
                " `min` or `max` switches there, and the constraint force has no direction"
            )
            hint = "start clear of that point, or state the branch that is meant as an equation without the switch"
            raise diagnostics.error("kink-at-start", message, row.location, hint)


def find(s: Symbols, p: ca.SX, equalities: ConstraintRows) -> Kinks | None:
    """The rows of constraints that switch; None where none does. `p`: all parameters."""
    holonomic = equalities.f.numel()
    rows, slopes, arguments = [], [], []
    for i, row in enumerate(equalities.rows):
        f = equalities.f[i] if i < holonomic else ca.SX(0)
        slope = ca.horzcat(ca.densify(equalities.B[i, :]), equalities.b[i], f)
        compared = switches.compared(f if i < holonomic else slope, [s.t, s.q, s.v, p])
        compared = [argument for argument in compared if ca.depends_on(argument, ca.vertcat(s.t, s.q))]
        if compared:
            rows.append(row)
            slopes.append(slope)
            arguments += compared
    if not rows:
        return None
    resting = (ca.vertcat(*slopes), ca.jacobian(ca.vertcat(*arguments), s.q))
    at_rest, gradients = ca.substitute(list(resting), [s.v], [ca.SX.zeros(s.v.shape)])
    found = SizedFunction("slopes", [s.t, s.q, p], [at_rest])
    entries = np.array(found.jac_sparsity(0, 1).get_triplet(), dtype=np.intp).reshape(2, -1)
    of_arguments = SizedFunction("gradients", [s.t, s.q, p], [gradients])
    return Kinks(tuple(rows), found, (entries[0] % len(rows), entries[1]), of_arguments)
