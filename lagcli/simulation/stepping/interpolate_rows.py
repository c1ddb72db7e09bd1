"""Rows of the table at instants at which they have no value of their own: limits of rows beside them.

Where rows of constraints are dependent at an instant, lambda may have a pole. r, v and R = M a - h (D.24) are smooth
where the motion is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.simulation.scheme import method
from lagcli.simulation.stepping.stepper import Stepper

if TYPE_CHECKING:
    # Most runs meet no singular configuration.
    from lagcli.simulation.singularity.singularity_step import SingularStep


# Where the drifts of a row stand in a line: rounding, which is not interpolated.
DRIFTS = slice(-method.BEYOND, -method.BEYOND + 2)


class InterpolationParameters:
    """Rows at and beside a singular configuration; distances are parts of the step. The tests are of
    `tests/unit/test_numbers_of_steps.py`."""

    __slots__ = ()

    window: float = 0.05
    """Lines this close to the instant are read off others. `test_lines_close_to_the_instant_are_read_off_others`."""
    beside: tuple[float, ...] = (0.06, 0.12, 0.2, 0.3)
    """The distances at which those stand. `test_a_column_has_no_value_on_its_pole`."""
    after: tuple[float, float, int] = 0.02, 0.7, 12
    """Where a run begins there: the window, the farthest line, and the number of lines.
    `test_a_line_at_the_instant_is_known_to_eleven_digits`."""
    broken: float = 1e-3
    """At a kink two interpolations differ by this part of the range.
    `test_a_column_that_is_not_smooth_has_no_value`."""
    rough: float = 1e-7
    """Less than this part of the column is rounding. `test_a_column_that_is_not_smooth_has_no_value`."""
    noise: float = 1e-8
    """And so is what is less than this part of the largest. `test_a_pole_that_is_rounding_beside_another_is_none`."""
    shrinks: float = 0.75
    """To less than this part, at half of the distance. `test_a_limit_is_where_differences_shrink`."""


PARAMETERS = InterpolationParameters()


def beside(h: float, is_start: bool) -> Floats:
    """Times from an instant in the middle of a step of length h, or at its start, at which lines of the table are
    read to interpolate those close to it, (k,)."""
    if is_start:  # Chebyshev's points: they amplify rounding least
        first, last, count = PARAMETERS.after
        cosines = np.cos(np.pi * (np.arange(count) + 0.5) / count)
        return np.asarray(((first + last) - (last - first) * cosines) / 2 * h)
    parts = np.array(PARAMETERS.beside)
    return np.concatenate([-parts[::-1], parts]) * h


def interpolated(taus: Floats, lines: Floats, tau: float) -> Floats:
    """A line of the table (w,) at a time tau after the instant, from lines (k, w) at times beside it. A column may have
    a pole of first order at the instant; on the pole it has no value, nor has a column that is not smooth there: fewer
    lines then give another."""
    carried = lines * taus[:, None]
    near = np.abs(taus) < np.abs(taus).max()
    moment = np.abs(carried).max(axis=0)
    least = np.maximum(doubles.ROOT * moment, PARAMETERS.noise * moment.max())
    has_pole = np.abs(_lagrange(taus, carried, 0.0)) > least
    plain = _lagrange(taus, lines, tau)
    largest = np.abs(lines).max(axis=0)
    rounding = PARAMETERS.rough * largest + PARAMETERS.noise * largest.max()
    allowed = np.maximum(PARAMETERS.broken * np.ptp(lines, axis=0), rounding)
    is_smooth = np.abs(plain - _lagrange(taus[near], lines[near], tau)) <= allowed
    on_pole = abs(tau) <= doubles.ROOT * float(np.abs(taus).max())
    beside = np.full(plain.shape, np.nan) if on_pole else _lagrange(taus, carried, tau) / tau
    return np.where(has_pole, beside, np.where(is_smooth, plain, np.nan))


def _lagrange(points: Floats, values: Floats, at: float) -> Floats:
    """The polynomial through values (k, w) at points (k,), at a point."""
    differences = points[:, None] - points[None, :] + np.eye(points.size)
    factors = at - points[None, :] + np.zeros((points.size, 1))
    np.fill_diagonal(factors, 1.0)
    weights = (factors / differences).prod(axis=1)
    return np.asarray(weights @ values)


def between(lines: Floats) -> Floats:
    """The limit (w,) in the middle of four lines (4, w) at equal distances but for the middle; nan where a column has
    none: the differences of its values then do not shrink with the distance, as at a jump or a pole."""
    outer, inner, inner_after, outer_after = lines
    with np.errstate(invalid="ignore"):  # what is not finite is reported by name when it is put
        rounding = doubles.ROOT * (np.abs(inner) + np.abs(inner_after))
        has_limit = np.abs(inner_after - inner) <= PARAMETERS.shrinks * np.abs(outer_after - outer) + rounding
        limit = (4 * (inner + inner_after) - (outer + outer_after)) / 6
    return np.asarray(np.where(has_limit, limit, np.nan))


def put_in_singular_step(run: Stepper, across: SingularStep, at: float) -> None:
    """Write the line at a time within the step; close to the instant it is the limit from both sides."""
    rows, step, tau = run.trial.rows, across.step, at - across.instant

    def put(at: float) -> None:
        rows.put(run.origin + at, step.state((at - step.t) / step.h))

    if abs(tau) > PARAMETERS.window * across.width:
        put(at)
        return
    taus = beside(across.width, across.is_start)
    lines = []
    for other in taus:
        put(across.instant + other)
        lines.append(rows.line.copy())
    found = np.array(lines)
    rows.line[:] = interpolated(taus, found, tau)
    rows.line[DRIFTS] = found[:, DRIFTS].max(axis=0)
    rows.line[0] = rows.at[0] = run.origin + at
