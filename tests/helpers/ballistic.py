"""Impacts of bodies on a line or in a plane under a constant acceleration, one by one, in as many digits as are asked
for: no steps, no tolerance, and none of the program.

Gaps are linear in positions, g = G r + g0, so that along a flight each is a parabola in t. Masses are given for every
coordinate. One contact is struck at a time, Lambda = -(1 + e) dg/(G M^-1 G^T). Where intervals vanish the contacts that
were struck stay together from there on.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from mpmath import lu_solve, matrix, mp, mpf, sqrt


@dataclasses.dataclass
class Flight:
    """Positions and velocities at the end, contacts that were struck with their times, and the time from which some
    stay together, None where none do."""

    r: list[mpf]
    v: list[mpf]
    struck: list[tuple[mpf, int]]
    collapsed: mpf | None = None


def flight(
    masses: Sequence[object],
    start: tuple[Sequence[object], Sequence[object]],
    contacts: Sequence[tuple[Sequence[object], object, object]],
    acceleration: Sequence[object],
    duration: object,
    digits: int = 120,
) -> Flight:
    """The motion from (r, v) up to a time; contacts: (row of G, g0, e)."""
    mp.dps = digits
    m, a = [mpf(x) for x in masses], [mpf(x) for x in acceleration]
    r, v = ([mpf(x) for x in part] for part in start)
    rows = [([mpf(x) for x in G], mpf(g0), mpf(e)) for G, g0, e in contacts]
    t, end, least = mpf(0), mpf(duration), mpf(10) ** (-digits // 3)
    struck: list[tuple[mpf, int]] = []
    last = -1
    while True:
        found = [
            (_next(_dot(G, r) + g0, _dot(G, v), _dot(G, a), j == last, end - t), j)
            for j, (G, g0, _) in enumerate(rows)
        ]
        tau, j = min(found)
        is_over = tau >= end - t
        tau = min(tau, end - t)
        r = [x + tau * w + tau * tau / 2 * b for x, w, b in zip(r, v, a, strict=True)]
        v = [w + tau * b for w, b in zip(v, a, strict=True)]
        t += tau
        if is_over:
            return Flight(r, v, struck)
        G, _, e = rows[j]
        push = -(1 + e) * _dot(G, v) / sum(x * x / k for x, k in zip(G, m, strict=True))
        v = [w + push * x / k for w, x, k in zip(v, G, m, strict=True)]
        struck.append((t, j))
        last = j
        if tau < least:
            own = sorted({j for _, j in struck[-2 * len(rows) :]})
            left, G = end - t, [rows[j][0] for j in own]
            v, a = (_together(m, G, x) for x in (v, a))
            r = [x + left * w + left * left / 2 * b for x, w, b in zip(r, v, a, strict=True)]
            return Flight(r, [w + left * b for w, b in zip(v, a, strict=True)], struck, t)


def _together(m: list[mpf], G: list[list[mpf]], x: list[mpf]) -> list[mpf]:
    """The velocities or accelerations nearest to x in the metric of the masses with G x = 0; contacts push or rest."""
    D = matrix([[_dot(one, [y / k for y, k in zip(other, m, strict=True)]) for other in G] for one in G])
    push = lu_solve(D, matrix([-_dot(row, x) for row in G]))
    assert all(each >= -_rounding(push) for each in push), "they stay together"
    change = [sum(push[i] * row[k] for i, row in enumerate(G)) / m[k] for k in range(len(m))]
    return [y + z for y, z in zip(x, change, strict=True)]


def _rounding(push: matrix) -> mpf:
    """Rounding of impulses."""
    return mpf(10) ** (-mp.dps // 2) * max(abs(each) for each in push)


def _dot(one: Sequence[mpf], other: Sequence[mpf]) -> mpf:
    return mpf(sum(x * y for x, y in zip(one, other, strict=True)))


def _next(g: mpf, rate: mpf, bend: mpf, is_zero: bool, never: mpf) -> mpf:
    """The time after which g + rate t + bend t^2/2 falls to zero; is_zero: it is there now, and goes up."""
    if is_zero:
        return -2 * rate / bend if bend < 0 < rate else never
    if bend == 0:
        return -g / rate if rate < 0 else never
    inside = rate * rate - 2 * bend * g
    if inside < 0:
        return never
    root = sqrt(inside)
    # The first crossing from above to below, of the form that loses no digits.
    if rate < 0:
        return 2 * g / (root - rate)
    return (-rate - root) / bend if bend < 0 else never
