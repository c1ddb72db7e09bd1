"""The points at which `abs`, `sign`, `min` or `max` makes the gradient of a constraint jump.

At such a point the constraint surface has an edge. The rule of multipliers needs a gradient there, and the velocity
of a motion that goes over the edge would have to jump: an impact, which the equations (D.24) do not describe.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.equations import operation_graph
from lagcli.equations.rows import ConstraintRows, Row
from lagcli.equations.sized_function import SizedFunction
from lagcli.equations.symbols import Symbols
from lagcli.errors import diagnostics
from lagcli.frozen import frozen

Floats = npt.NDArray[np.float64]

# The operations that switch, and what is compared with zero by each. The last four are what derivatives of `min` and
# `max` are made of.
ARGUMENTS: dict[int, Callable[..., ca.SX]] = dict.fromkeys(
    (
        *(code for code, row in operation_graph.FUNCTIONS.items() if row.is_piecewise),
        *(ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE),
    ),
    lambda a, b=0: a - b,
)


class KinkParameters:
    """Jumps of the gradient of a row; lengths are parts of the size of the coordinates, or of the way taken.

    The tests are of `tests/unit/test_numbers_of_rows.py`.
    """

    __slots__ = ()

    offset: float = 1e-9
    """How far off a switch its two sides are looked at. `test_a_switch_is_looked_at_nine_digits_off` fails at
    1e-10 and 1e-8."""
    farther: float = 1e-5
    """And from farther off: what draws near as the distance shrinks is no jump.
    `test_a_jump_is_compared_with_what_changes_farther_off` fails at 1e-6 and 0.0001."""
    jump: float = 1e-6
    """The part of a gradient by which its sides must differ: a change that is only steep is no jump.
    `test_a_gradient_jumps_by_a_millionth` fails at 1e-7 and 1e-5."""
    halvings: int = 60
    """Bisections of the way up to a switch: an interval of the size of its ends has 53 bits.
    `test_a_slope_that_only_changes_on_the_way_does_not_jump` fails at 6."""


PARAMETERS = KinkParameters()


@frozen
class Kinks:
    """The switches of all rows: `switches` gives (t, q, p) -> u (K,), each zero where it switches.

    `slopes` gives (t, q, p) -> B, b and f (K, n + 2) of the row each switch belongs to, `rows` its name; b at rest,
    f zero where the row is differential.
    """

    rows: tuple[Row, ...]
    switches: ca.Function
    slopes: ca.Function

    def at(self, t: float, q: Floats, p: Floats) -> Row | None:
        """A row that jumps at a configuration, itself or its gradient, or None."""
        size = float(np.abs(q).max(initial=0.0)) or 1.0
        way = np.random.default_rng(0).standard_normal(q.size) * size
        here = self._slopes(t, q, p)
        near, far = (
            np.abs(self._slopes(t, q + h * way, p) - self._slopes(t, q - h * way, p)).max(axis=1, initial=0.0)
            for h in (PARAMETERS.offset, PARAMETERS.farther)
        )
        scale = np.abs(here).max(axis=1, initial=0.0) + far
        # Where the slopes of both sides draw near as their distance shrinks there is no jump.
        with np.errstate(invalid="ignore"):
            jumps = np.isfinite(here).all(axis=1) & (near > PARAMETERS.jump * scale) & (near > 0.1 * far)
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
            raise diagnostics.ModelError(
                [diagnostics.Diagnostic("kink-at-start", message, row.location, hint)]
            )

    def crossed(self, before: tuple[float, Floats], after: tuple[float, Floats], p: Floats) -> Row | None:
        """A row whose gradient jumps on the way between two configurations (t, q), or None."""
        old, new = (np.array(self.switches(t, q, p)).ravel() for t, q in (before, after))
        for k in np.flatnonzero((old != 0.0) & (np.sign(old) != np.sign(new))).tolist():
            if self._jumps_between(k, before, after, p):
                return self.rows[k]
        return None

    def _jumps_between(
        self, k: int, before: tuple[float, Floats], after: tuple[float, Floats], p: Floats
    ) -> bool:
        """True if the gradient jumps where switch k changes its sign on the straight way."""

        def point(part: float) -> tuple[float, Floats]:
            return before[0] + part * (after[0] - before[0]), before[1] + part * (after[1] - before[1])

        sign = np.sign(float(self.switches(*before, p)[k]))
        low, high = 0.0, 1.0
        for _ in range(PARAMETERS.halvings):
            middle = (low + high) / 2
            if np.sign(float(self.switches(*point(middle), p)[k])) == sign:
                low = middle
            else:
                high = middle
        one, other = (
            self._slopes(*point(part), p)[k] for part in (low - PARAMETERS.offset, high + PARAMETERS.offset)
        )
        return bool(np.abs(one - other).max(initial=0.0) > PARAMETERS.jump * np.abs(one).max(initial=0.0))

    def _slopes(self, t: float, q: Floats, p: Floats) -> Floats:
        return np.array(self.slopes(t, q, p)).reshape(len(self.rows), -1)


def find(s: Symbols, p: ca.SX, equalities: ConstraintRows) -> Kinks | None:
    """The switches of constraints; None where they have none. `p`: all parameters."""
    holonomic = equalities.f.numel()
    rows, arguments, slopes = [], [], []
    for i, row in enumerate(equalities.rows):
        f = equalities.f[i] if i < holonomic else ca.SX(0)
        slope = ca.horzcat(ca.densify(equalities.B[i, :]), equalities.b[i], f)
        value = f if i < holonomic else slope
        for argument in switch_arguments(value, [s.t, s.q, s.v, p]):
            if ca.depends_on(argument, ca.vertcat(s.t, s.q)):
                rows.append(row)
                arguments.append(argument)
                slopes.append(slope)
    if not rows:
        return None
    inputs = [s.t, s.q, p]
    free = [
        ca.substitute(part, s.v, ca.SX.zeros(s.v.shape))
        for part in (ca.vertcat(*arguments), ca.vertcat(*slopes))
    ]
    return Kinks(
        tuple(rows), SizedFunction("switches", inputs, free[:1]), SizedFunction("slopes", inputs, free[1:])
    )


def switch_arguments(value: ca.SX, inputs: Sequence[ca.SX]) -> list[ca.SX]:
    """The values compared with zero by `abs` and `sign`, and the difference of what `min` and `max`, and their
    derivatives, compare."""
    found: list[ca.SX] = []

    def visit(op: int, parts: list[ca.SX], result: ca.SX) -> ca.SX:
        if op in ARGUMENTS:
            found.append(ARGUMENTS[op](*parts))
        return result

    operation_graph.replayed(ca.densify(ca.vec(value)), inputs, visit)
    return found


def on_side(op: int, parts: Sequence[ca.SX], side: float) -> ca.SX:
    """The value of an operation that switches where its argument has the sign `side`, 1 or -1."""
    if op in (ca.OP_FMIN, ca.OP_FMAX):
        return parts[0 if (side > 0) == (op == ca.OP_FMAX) else 1]
    if op == ca.OP_FABS:
        return side * parts[0]
    if op == ca.OP_SIGN:
        return ca.SX(side)
    return ca.SX(op == ca.OP_NE or (side < 0 and op in (ca.OP_LT, ca.OP_LE)))
