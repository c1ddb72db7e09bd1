"""Points where the gradients of rows and closed contacts depend on each other: there the multiplier rule need not hold.

At such a point a function may be smallest although no lambda balances its gradient: min x on x^3 = y^2; and with
contacts max x on 0 <= y <= (1 - x)^3 (Kuhn and Tucker), where multipliers of one sign balance each other.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.statics import point_search, point_type, refine, static_report
from lagcli.statics.point_search import PointSearch
from lagcli.statics.rest_equations import Scales
from lagcli.statics.static_problem import StaticProblem

Floats = npt.NDArray[np.float64]


class DependenceParameters:
    """Numbers of the search for points where gradients depend on each other.

    The tests are of `tests/unit/test_numbers_of_rest_searches.py` and `tests/physics/test_statics_proofs.py`.
    """

    __slots__ = ()

    tries: int = 12
    """Starts at random, beside the start of the model.
    `test_such_points_are_sought_from_twelve_starts_beside_the_first` fails at 1 and 120."""
    tries_with_contacts: int = 4
    """The same for each set of closed contacts, of which there are several.
    `test_such_points_are_sought_from_four_starts_where_contacts_close` fails at 0 and 40."""
    damped: int = 80
    """Damped steps of each. `test_such_points_are_sought_from_twelve_starts_beside_the_first` fails at 8 and 800."""
    digits: int = 3
    """Digits of a point behind the size of things that are tried, for rows that hold there to rounding.
    `test_the_corner_of_kuhn_and_tucker_is_named_exactly` fails at 0 and 30."""
    zero: float = 1e-10
    """The residual of a point, of rows of length one. `test_such_a_point_has_no_residual` fails at 1e-11 and 1e-9."""


PARAMETERS = DependenceParameters()
# Such zeros are double: coordinates of this part of the size of things are zero, and points closer than ten times it
# are one.
NEAR = point_search.PARAMETERS.same_of_flat


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class DependentGradients:
    """c = 0, g = 0, B^T mu = 0, |mu| = 1 as a residual of (q, mu), for some of the rows and some closed contacts.

    lengths: of their gradients, in turn; scales: of c and g.
    """

    problem: StaticProblem
    rows: Sequence[int]
    closed: Sequence[int]
    lengths: Floats
    scales: Scales

    def __call__(self, x: Floats) -> tuple[Floats, Floats] | None:
        """Residual and gradient."""
        problem, closed = self.problem, list(self.closed)
        q, mu = x[: problem.n], x[problem.n :]
        lam = problem.nothing
        lam[[*self.rows, *(problem.C + k for k in closed)]] = mu / self.lengths
        with_mu, without = (problem.at(problem.t, q, each) for each in (lam, problem.nothing))
        G, g = with_mu.G[closed], with_mu.g[closed]
        if not with_mu.finite or not without.finite or not np.isfinite(G).all() or not np.isfinite(g).all():
            return None
        unit = np.vstack([with_mu.B[list(self.rows)], G]) / self.lengths[:, None]
        size = np.concatenate([self.scales.conditions, self.scales.contacts[closed]])
        on = np.concatenate([with_mu.c, g]) / size
        residual = np.concatenate([on, unit.T @ mu, [mu @ mu - 1]])
        slopes = np.vstack([with_mu.dc, G]) / size[:, None]
        by_q = np.vstack([slopes, with_mu.K - without.K, np.zeros((1, problem.n))])
        by_mu = np.vstack([np.zeros((on.size, mu.size)), unit.T, 2 * mu[None]])
        return residual, np.hstack([by_q, by_mu])

    def bends(self, q: Floats, mu: Floats) -> bool:
        """True if the gradients change with q: constant ones that are independent somewhere are so everywhere."""
        found = self(np.concatenate([q, mu]))
        first = self.problem.laws.c.numel() + len(self.closed)
        return found is None or bool(found[1][first:-1, : self.problem.n].any())


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class SingularPoint:
    """A configuration at which gradients depend on each other, and whether those of contacts are among them."""

    q: Floats
    with_contacts: bool


def singular_points(search: PointSearch) -> list[SingularPoint]:
    """Configurations on the surface where rows, or rows and contacts, that are independent elsewhere depend on each
    other."""
    problem = search.problem
    limits = point_search.PARAMETERS
    if problem.n > limits.most_coordinates or len(problem.times) > 1:
        return []
    found: list[SingularPoint] = []
    contacts = range(problem.K if limits.most_contacts >= problem.K else 0)
    for size in range(len(contacts) + 1):
        for closed in itertools.combinations(contacts, size):
            if problem.C or closed:
                _find(search, closed, found)
    return found


def _find(search: PointSearch, closed: tuple[int, ...], found: list[SingularPoint]) -> None:
    """Add the points with these contacts closed."""
    problem, scales = search.problem, search.scales
    random = np.random.default_rng(search.options.seed + 1)
    # Rows that are independent at a point anywhere; none where contacts are not independent of them
    anywhere = problem.begin + 0.3 * scales.length * random.standard_normal(problem.n)
    values = problem.at(problem.t, anywhere, problem.nothing)
    B, G = values.B, values.G[list(closed)]
    rows: list[int] = []
    for row in range(problem.C):
        if np.isfinite(B[row]).all() and point_type.unit_rank(B[[*rows, row]]) > len(rows):
            rows.append(row)
    together = np.vstack([B[rows], G])
    if closed and (not np.isfinite(G).all() or point_type.unit_rank(together) < len(together)):
        return
    values = problem.at(problem.t, problem.begin, problem.nothing)
    gradients = np.vstack([values.B[rows], values.G[list(closed)]])
    lengths = np.maximum(np.linalg.norm(np.nan_to_num(gradients), axis=1), 1e-3)
    equations = DependentGradients(problem, rows, closed, lengths, scales)
    begins = [problem.begin, *(one.point.q for one in search.points if not one.type.unique)]
    tries = PARAMETERS.tries_with_contacts if closed else PARAMETERS.tries
    begins += search.others(tries)
    for begin in begins:
        mu = random.standard_normal(lengths.size)
        mu /= np.linalg.norm(mu)
        if closed and not equations.bends(begin, mu):
            return
        end = refine.solve(equations, np.concatenate([begin, mu]), PARAMETERS.damped)
        if end is None or not end.residual <= PARAMETERS.zero or not np.isfinite(end.x).all():
            continue
        pushes = end.x[problem.n + len(rows) :]
        if closed and not ((pushes > NEAR).all() or (pushes < -NEAR).all()):
            continue  # contacts of both signs leave a side free, on which the rule holds
        q = _rounded(equations, end.x, scales.length)
        g = problem.at(problem.t, q, problem.nothing).g / scales.contacts
        if (g < -NEAR * scales.length).any():
            continue
        if not any(search.apart(q, other.q) <= 10 * NEAR for other in found):
            found.append(SingularPoint(q, bool(closed)))


def _rounded(equations: DependentGradients, x: Floats, length: float) -> Floats:
    """The configuration of a zero, which is a double one, to the digits that are no rounding."""
    n = equations.problem.n
    q = x[:n]
    exact = np.where(np.abs(q) <= NEAR * length, 0.0, q)
    for tried in (np.round(q / length, PARAMETERS.digits) * length, exact):
        again = equations(np.concatenate([tried, x[n:]]))
        if again is None or np.linalg.norm(again[0]) > NEAR:
            continue
        conditions = len(equations.closed) + equations.problem.laws.c.numel()
        off = np.abs(again[0][:conditions]).max(initial=0.0)
        if tried is exact or off <= point_search.PARAMETERS.rounding:
            return np.asarray(tried) + 0.0
    return q


def notes(search: PointSearch, names: Sequence[str], value: str) -> list[str]:
    """Sentences on such points; `value`: the function that is asked for."""
    notes = []
    found, most = singular_points(search), point_search.PARAMETERS.most_named
    for point in found[:most]:
        which = "closed inequalities" if point.with_contacts else "the rows"
        notes.append(
            f"at {static_report.place(names, point.q)} the gradients of {which} depend on each other: the multiplier"
            " rule need not hold there, and it may be an extreme without lambda"
            f" ({value} = {search.problem.value(point.q):.9g})"
        )
    if len(found) > most:
        notes.append("there are more such points")
    return notes
