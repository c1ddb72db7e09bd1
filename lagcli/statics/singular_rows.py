"""Points where the gradients of the rows depend on each other: there the multiplier rule need not hold.

At such a point a function may be smallest although no lambda balances its gradient: min x on x^3 = y^2.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.statics import newton, point_type
from lagcli.statics.point_search import PointSearch
from lagcli.statics.static_problem import StaticProblem

Floats = npt.NDArray[np.float64]


class DependenceParameters:
    """Numbers of the search for points where gradients depend on each other.

    The tests are of `tests/unit/test_numbers_of_rest_searches.py`.
    """

    __slots__ = ()

    most_coordinates: int = 12
    """Of more coordinates no such points are looked for: starts at random find none in so many dimensions.
    `test_places_of_dependent_gradients_are_sought_among_twelve_coordinates` fails at 1 and 120."""
    tries: int = 12
    """Starts at random, beside the start of the model.
    `test_such_points_are_sought_from_twelve_starts_beside_the_first` fails at 1 and 120."""
    damped: int = 80
    """Damped steps of each. `test_such_points_are_sought_from_twelve_starts_beside_the_first` fails at 8 and
    800."""
    most_named: int = 4
    """Points that a note names; of more it gives the number. `test_a_note_names_four_such_points` fails at 0
    and 40."""
    zero: float = 1e-10
    """The residual of a point, of rows of length one. `test_such_a_point_has_no_residual` fails at 1e-11 and
    1e-9."""
    near: float = 3e-4
    """Such zeros are double, and found to the root of rounding: coordinates of this part of the size of
    things are zero, and points closer than ten times it are one.
    `test_a_coordinate_of_such_a_point_is_zero_to_the_root_of_rounding` fails at 3e-5 and 0.003."""


PARAMETERS = DependenceParameters()


class DependentGradients:
    """c = 0, B^T mu = 0, |mu| = 1 as a residual of (q, mu), for some of the rows."""

    def __init__(self, problem: StaticProblem, rows: Sequence[int], lengths: Floats, size: Floats) -> None:
        self._problem, self._rows, self._lengths, self._size = problem, list(rows), lengths, size

    def __call__(self, x: Floats) -> tuple[Floats, Floats] | None:
        """Residual and gradient."""
        problem = self._problem
        q, mu = x[: problem.n], x[problem.n :]
        lam = problem.nothing
        lam[self._rows] = mu / self._lengths
        with_mu, without = (problem.at(problem.t, q, each) for each in (lam, problem.nothing))
        if not with_mu.finite or not without.finite:
            return None
        unit = with_mu.B[self._rows] / self._lengths[:, None]
        count = mu.size
        residual = np.concatenate([with_mu.c / self._size, unit.T @ mu, [mu @ mu - 1]])
        by_q = np.vstack([with_mu.dc / self._size[:, None], with_mu.K - without.K, np.zeros((1, problem.n))])
        by_mu = np.vstack([np.zeros((with_mu.c.size, count)), unit.T, 2 * mu[None]])
        return residual, np.hstack([by_q, by_mu])


def singular_points(search: PointSearch) -> list[Floats]:
    """Configurations on the surface where rows that are independent elsewhere depend on each other."""
    problem, scales = search.problem, search.scales
    if not problem.C or problem.n > PARAMETERS.most_coordinates or len(problem.times) > 1:
        return []
    random = np.random.default_rng(search.options.seed + 1)
    rows = _independent(problem, scales.length, random)
    B = problem.at(problem.t, problem.begin, problem.nothing).B
    lengths = np.maximum(np.linalg.norm(B[rows], axis=1), 1e-3)
    equations = DependentGradients(problem, rows, lengths, scales.conditions)
    found: list[Floats] = []
    begins = [problem.begin, *(one.point.q for one in search.points if not one.type.unique)]
    begins += [
        problem.begin + scales.length * random.standard_normal(problem.n) for _ in range(PARAMETERS.tries)
    ]
    for begin in begins:
        mu = random.standard_normal(len(rows))
        end = newton.solve(equations, np.concatenate([begin, mu / np.linalg.norm(mu)]), PARAMETERS.damped)
        if end is None or not end.residual <= PARAMETERS.zero or not np.isfinite(end.x).all():
            continue
        q = end.x[: problem.n]
        q = np.where(np.abs(q) <= PARAMETERS.near * scales.length, 0.0, q)
        again = equations(np.concatenate([q, end.x[problem.n :]]))
        if again is None or np.linalg.norm(again[0]) > PARAMETERS.near:
            q = end.x[: problem.n]
        if not any(search.apart(q, other) <= 10 * PARAMETERS.near for other in found):
            found.append(q)
    return found


def _independent(problem: StaticProblem, length: float, random: np.random.Generator) -> list[int]:
    """Rows that are independent at a point anywhere."""
    q = problem.begin + 0.3 * length * random.standard_normal(problem.n)
    B = problem.at(problem.t, q, problem.nothing).B
    chosen: list[int] = []
    for row in range(problem.C):
        if np.isfinite(B[row]).all() and point_type.unit_rank(B[[*chosen, row]]) > len(chosen):
            chosen.append(row)
    return chosen


def notes(search: PointSearch, names: Sequence[str], value: str) -> list[str]:
    """Sentences on such points; `value`: the function that is asked for."""
    notes = []
    found = singular_points(search)
    for q in found[: PARAMETERS.most_named]:
        where = ", ".join(f"{name} = {x:.9g}" for name, x in zip(names, q, strict=True))
        notes.append(
            f"at {where} the gradients of the rows depend on each other: the multiplier rule need not hold there, and"
            f" it may be an extreme without lambda ({value} = {search.problem.value(q):.9g})"
        )
    if len(found) > PARAMETERS.most_named:
        notes.append("there are more such points")
    return notes
