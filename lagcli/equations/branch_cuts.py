"""Holonomic rows that go on smoothly where `atan2` or `atan` jumps: `z = h*atan2(y, x)` is a helix of many turns.

An angle from `atan2` jumps by 2 pi at its cut (y = 0, x < 0), one from `atan` by pi where its argument goes through
infinity. Where that changes f (D.2) by a constant, its differential (D.5) has no jump, and f with k times the constant
after k turns is the same law. Elsewhere the row itself jumps.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.equations.symbols import Symbols
from lagcli.frozen import frozen
from lagcli.smoothness import operation_graph
from lagcli.smoothness.sized_function import SizedFunction

T = TypeVar("T", npt.NDArray[np.float64], ca.SX)

PERIODS = {code: row.period for code, row in operation_graph.FUNCTIONS.items() if row.period}


class CutParameters:
    """The effect of one turn of an angle on a row, and where an angle is at its cut. The tests are of
    `tests/unit/test_numbers_of_rows.py`."""

    __slots__ = ()

    points: int = 3
    """So many points beside the start at which that is looked at.
    `test_a_turn_is_looked_at_in_three_places_beside_the_start` fails at 0 and 30."""
    offset: float = 0.3
    """How far they are from it, as a part of its size.
    `test_a_turn_is_looked_at_in_three_places_beside_the_start` fails at 0.03 and 3."""


PARAMETERS = CutParameters()
SAME, PASSED, JUMPS = range(3)
# A value with symbols for angles in it, and whether t or q is in it.
_Opened = tuple[ca.SX, bool]


@frozen
class Cuts:
    """The angles of J calls of `atan2` and `atan` in holonomic rows, and f (s,) continued across their cuts.

    f depends on `references` (J,), the last entries of p: where each angle was last, counted through all turns; with 0
    f is what the file says. value: (t, q, p) -> f; angles: (t, q, p) -> (J,), as the functions give them; periods (J,).
    rows, nodes, verdicts: what a turn of an angle does to a row: it is the SAME, or f changes by a constant and the row
    is PASSED, or the row JUMPS; change: (t, q, p) -> that by which a row changes, its slope, and its scale.
    """

    f: ca.SX
    references: ca.SX
    value: ca.Function
    angles: ca.Function
    periods: Floats
    rows: tuple[int, ...]
    nodes: tuple[int, ...]
    verdicts: tuple[int, ...]
    change: ca.Function

    @property
    def count(self) -> int:
        return len(self.periods)

    @property
    def first(self) -> int:
        """The range of the references in p."""
        return int(self.angles.size1_in(2)) - self.count

    def begin(self, t: float, q: Floats, p: Floats) -> Floats:
        """p for a start: an angle on its cut lies on the side on which its rows are satisfied best."""
        p = p.copy()
        here = np.array(self.angles(t, q, p)).ravel()
        for j in np.flatnonzero(np.abs(here) >= self.periods / 2 - doubles.ZERO).tolist():
            residuals = []
            for side in (here[j], -here[j]):
                p[self.first + j] = side
                residuals.append(float(np.abs(np.array(self.value(t, q, p))).sum()))
            p[self.first + j] = 0.0 if residuals[0] <= residuals[1] else -here[j]
        return p

    def counted(self, t: float, q: Floats, p: Floats) -> Floats:
        """The angles (J,) at a point, each within half a period of its reference."""
        here = np.array(self.angles(t, q, p)).ravel()
        return np.asarray(here - self.periods * _turns(here, p[self.first :], self.periods, np.ceil))

    @property
    def passing(self) -> list[int]:
        """The numbers of the pairs, among `rows` and `nodes`, in which a row is continued."""
        return [k for k, verdict in enumerate(self.verdicts) if verdict == PASSED]

    def passed(self, j: int) -> list[int]:
        """The rows that are continued across the cut of angle j."""
        return [self.rows[k] for k in self.passing if self.nodes[k] == j]

    def jumps(self, t: float, q: Floats, p: Floats) -> dict[int, tuple[float, ...]]:
        """The constants by which rows that are continued jump in what the file says, ascending, by their numbers."""
        by = np.array(self.change(t, q, p[: self.first], np.zeros(self.change.size1_in(3))))[:, 0]
        found: dict[int, list[float]] = {}
        for k in self.passing:
            sizes = found.setdefault(self.rows[k], [])
            size = abs(float(by[k]))
            if size and not any(abs(size / other - round(size / other)) < doubles.ZERO for other in sizes):
                sizes.append(size)
        return {row: tuple(sorted(sizes)) for row, sizes in found.items() if sizes}

    def hold_for(self, t: float, q: Floats, p: Floats) -> bool:
        """True if the verdicts are the same with other parameters and another start."""
        return _verdicts(self.change, t, q, p[: self.first]) == self.verdicts


def find(f: ca.SX, s: Symbols, p: ca.SX, start: tuple[float, Floats, Floats]) -> Cuts | None:
    """The cuts of holonomic rows f (s,), judged at a start t, q, p; None where they have none."""
    judged = _judged(f, s, p) if f.numel() else None
    if judged is None:
        return None
    angles, periods, rows, nodes, by, change = judged
    verdicts = _verdicts(change, *start)
    passed = [k for k, verdict in enumerate(verdicts) if verdict == PASSED]
    references = ca.SX.sym("reference", len(periods))
    turns = _turns(angles, references, ca.SX(ca.DM(periods)), ca.ceil)
    continued = ca.SX(f)
    for k in passed:
        continued[rows[k]] -= turns[nodes[k]] * by[k]
    inputs = [s.t, s.q, ca.vertcat(p, references)]
    value, given = SizedFunction("value", inputs, [continued]), SizedFunction("angles", inputs, [angles])
    return Cuts(continued, references, value, given, np.array(periods), rows, nodes, verdicts, change)


def jumping(value: ca.SX, s: Symbols, p: ca.SX, start: tuple[float, Floats, Floats]) -> list[int]:
    """The entries of a column of (t, q, v, p) that jump at the cut of an angle in them, by a constant or not."""
    judged = _judged(value, s, p)
    if judged is None:
        return []
    _, _, rows, _, _, change = judged
    pairs = zip(rows, _verdicts(change, *start), strict=True)
    return sorted({row for row, verdict in pairs if verdict != SAME})


def _judged(
    f: ca.SX, s: Symbols, p: ca.SX
) -> tuple[ca.SX, list[float], tuple[int, ...], tuple[int, ...], ca.SX, ca.Function] | None:
    """The angles (J,) in a column, their periods, the entries and angles that go together, by how much one turn of the
    angle changes the entry, and `Cuts.change`; None without angles."""
    f, angles, periods, symbols = _opened(f, s, p)
    if not periods:
        return None
    slopes = ca.jacobian(f, symbols)
    rows, nodes = (tuple(part) for part in slopes.sparsity().get_triplet())
    moving = ca.vertcat(s.t, s.q, symbols)
    each = ca.densify(ca.vec(slopes.nz[:]))
    varying = sorted(set(ca.jacobian_sparsity(each, moving).row())) if rows else []
    slope = each * ca.vertcat(ca.SX(0, 1), *(periods[j] for j in nodes))
    by = ca.SX(slope)
    for k in varying:
        theta, period = symbols[nodes[k]], periods[nodes[k]]
        by[k] = ca.substitute(f[rows[k]], theta, theta + period) - f[rows[k]]
    # change(t, q, p, direction) -> by how much rows change in one turn, this along a direction, and df/dtheta times the
    # period; all rates are 1.
    direction = ca.SX.sym("direction", moving.numel())
    along = ca.jtimes(by, moving, direction)
    columns = ca.substitute(ca.densify(ca.horzcat(by, along, slope)), symbols, angles)
    columns = ca.substitute(columns, s.v, ca.SX.ones(s.v.shape))
    change = SizedFunction("change", [s.t, s.q, p, direction], [columns])
    return angles, periods, rows, nodes, ca.substitute(by, symbols, angles), change


def _turns(here: T, last: T, periods: T, ceil: Callable[[T], T]) -> T:
    """Whole periods by which angles are ahead of the last ones; none for -pi < theta <= pi beside 0."""
    return ceil((here - last) / periods - 0.5)


def _opened(f: ca.SX, s: Symbols, p: ca.SX) -> tuple[ca.SX, ca.SX, list[float], ca.SX]:
    """f with a symbol for each angle that t or q moves; the angles (J,), their periods, and the symbols."""
    inputs = [s.t, s.q, s.v, p]
    values: list[ca.SX] = []
    symbols: list[ca.SX] = []
    periods: list[float] = []

    def look(op: int, parts: list[_Opened], expression: operation_graph.Expression) -> _Opened:
        moves = any(part_moves for _, part_moves in parts)
        if op not in PERIODS or not moves:
            return operation_graph.applied(op, [value for value, _ in parts]), moves
        values.append(expression())
        periods.append(PERIODS[op])
        symbols.append(ca.SX.sym(f"angle {len(symbols)}"))
        return symbols[-1], True

    def leaf(number: int | None, entry: float) -> _Opened:
        return ca.SX(entry) if number is None else inputs[number][int(entry)], number in (0, 1)

    opened = [value for value, _ in operation_graph.folded(f, inputs, leaf, look)]
    none = ca.SX(0, 1)
    return ca.vertcat(none, *opened), ca.vertcat(none, *values), periods, ca.vertcat(none, *symbols)


def _verdicts(change: ca.Function, t: float, q: Floats, p: Floats) -> tuple[int, ...]:
    """The effect of one turn, for each row and angle, from numbers at the start and beside it."""
    random = np.random.default_rng(0)
    size = float(np.abs(q).max(initial=0.0)) or 1.0
    found = []
    for k in range(1 + PARAMETERS.points):
        angles = change.size1_in(3) - 1 - q.size
        scales = [abs(t) or 1.0, *np.full(q.size, size), *np.ones(angles)]
        direction = scales * random.standard_normal(change.size1_in(3))
        beside = PARAMETERS.offset * size * random.standard_normal(q.size) if k else 0.0
        found.append(np.array(change(t, q + beside, p, direction)))
    by, along, slope = np.abs(np.array(found)).max(axis=0).T if change.size1_out(0) else np.zeros((3, 0))
    scale = np.maximum(by, slope)
    same, steady = by <= doubles.ZERO * scale, along <= doubles.ZERO * scale
    return tuple(SAME if a else PASSED if b else JUMPS for a, b in zip(same, steady, strict=True))
