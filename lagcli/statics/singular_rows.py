"""Points where the gradients of rows and closed contacts depend on each other: there the multiplier rule need not hold.

At such a point a function may be smallest although no lambda balances its gradient: min x on x^3 = y^2; and with
contacts max x on 0 <= y <= (1 - x)^3 (Kuhn and Tucker), where multipliers of one sign balance each other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.statics import point_search, point_type, refine, rest_equations, static_report
from lagcli.statics.point_search import PointSearch
from lagcli.statics.refine import Residual

# Such zeros are double: coordinates of this part of the size of things are zero, and points closer than ten times it
# are one.
NEAR = point_search.PARAMETERS.same_of_flat


def notes(search: PointSearch, names: Sequence[str], value: str) -> list[str]:
    """Sentences on such points; `value`: the function that is asked for."""
    problem, limits = search.problem, point_search.PARAMETERS
    if problem.n > limits.most_coordinates or len(problem.times) > 1:
        return []
    places: list[tuple[Floats, str]] = []
    for closed in problem.contact_sets() if limits.most_contacts >= problem.K else [()]:
        which = "closed inequalities" if closed else "the rows"
        for q in _singular(search, closed) if problem.C or closed else ():
            if not any(search.apart(q, other) <= 10 * NEAR for other, _ in places):
                places.append((q, which))
    told = [
        f"at {static_report.place(names, q)} the gradients of {which} depend on each other: the multiplier"
        " rule need not hold there, and it may be an extreme without lambda"
        f" ({value} = {problem.value(q):.9g})"
        for q, which in places[: limits.most_named]
    ]
    return told + ["there are more such points"] * (len(places) > limits.most_named)


def _singular(search: PointSearch, closed: tuple[int, ...]) -> Iterator[Floats]:
    """Configurations on the surface where rows and these closed contacts, independent elsewhere, depend on each
    other."""
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
    chosen = [*rows, *(problem.C + k for k in closed)]
    gradients = problem.at(problem.t, problem.begin, problem.nothing).rows(range(problem.K))[chosen]
    lengths = np.maximum(np.linalg.norm(np.nan_to_num(gradients), axis=1), rest_equations.SMALL)
    dependent = _dependent(search, chosen, closed, lengths)
    begins = [problem.begin, *(one.point.q for one in search.points if not one.type.unique)]
    conditions = problem.laws.c.numel() + len(closed)
    for begin in [*begins, *search.others(4 if closed else 12)]:
        mu = random.standard_normal(lengths.size)
        x = np.concatenate([begin, mu / np.linalg.norm(mu)])
        # Constant gradients that are independent somewhere are so everywhere.
        here = dependent(x) if closed else None
        if here is not None and not here[1][conditions:-1, : problem.n].any():
            return
        end = refine.solve(dependent, x, 80)
        if end is None or not end.distance <= 100 * doubles.VALUE or not np.isfinite(end.x).all():
            continue
        pushes = end.x[problem.n + len(rows) :]
        if closed and not ((pushes > NEAR).all() or (pushes < -NEAR).all()):
            continue  # contacts of both signs leave a side free, on which the rule holds
        # The digits that are no rounding: three where rows hold there to rounding, or zero what is nearly so
        q = end.x[: problem.n]
        zeroed = np.where(np.abs(q) <= NEAR * scales.length, 0.0, q)
        for tried in (np.round(q / scales.length, 3) * scales.length, zeroed):
            again = dependent(np.concatenate([tried, end.x[problem.n :]]))
            if again is None or np.linalg.norm(again[0]) > NEAR:
                continue
            if tried is zeroed or np.abs(again[0][:conditions]).max(initial=0.0) <= 4 * doubles.EPS:
                q = tried + 0.0
                break
        g = problem.at(problem.t, q, problem.nothing).g / scales.contacts
        if not (g < -NEAR * scales.length).any():
            yield q


def _dependent(
    search: PointSearch, rows: Sequence[int], closed: tuple[int, ...], lengths: Floats
) -> Residual:
    """c = 0, g = 0, B^T mu = 0, |mu| = 1 as a residual of (q, mu), for some rows of (B, G) with their lengths; closed:
    contacts, the last of them."""
    problem, scales, contacts = search.problem, search.scales, list(closed)
    size = np.concatenate([scales.conditions, scales.contacts[contacts]])

    def residual(x: Floats) -> tuple[Floats, Floats] | None:
        q, mu = x[: problem.n], x[problem.n :]
        lam = problem.nothing
        lam[list(rows)] = mu / lengths
        with_mu, without = (problem.at(problem.t, q, each) for each in (lam, problem.nothing))
        G, g = with_mu.G[contacts], with_mu.g[contacts]
        if not with_mu.finite or not without.finite or not np.isfinite(G).all() or not np.isfinite(g).all():
            return None
        unit = with_mu.rows(range(problem.K))[list(rows)] / lengths[:, None]
        on = np.concatenate([with_mu.c, g]) / size
        slopes = np.vstack([with_mu.dc, G]) / size[:, None]
        by_q = np.vstack([slopes, with_mu.K - without.K, np.zeros((1, problem.n))])
        by_mu = np.vstack([np.zeros((on.size, mu.size)), unit.T, 2 * mu[None]])
        return np.concatenate([on, unit.T @ mu, [mu @ mu - 1]]), np.hstack([by_q, by_mu])

    return residual
