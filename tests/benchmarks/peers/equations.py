"""The accelerations (D.24) of the problems, written by hand for any algebra that has + - * /: lambda is eliminated.

They are for programs that solve ordinary differential equations, and hold what a person would write: point masses of
1 kg, rods as f = (|u|^2 - L^2)/2, and the factors L D L' of B B' by the entries that there are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

GRAVITY = 9.81


def start(problem: dict[str, Any]) -> tuple[Any, Any]:
    """q and v at the start."""
    if problem["kind"] == "disk":
        return np.zeros(4), np.array([0.0, -problem["a"] * problem["spin"], problem["turn"], problem["spin"]])
    held = set(problem["held"])
    q = np.ravel([point for k, point in enumerate(problem["points"]) if k not in held])
    return q, np.zeros(q.size)


def accelerations(problem: dict[str, Any], q: Sequence[Any], v: Sequence[Any], of: Any = np) -> list[Any]:
    """The second derivatives of q; `of` has sin and cos."""
    make: Callable[..., list[Any]] = {"network": _network, "disk": _disk}[problem["kind"]]
    return make(problem, q, v, of)


def _network(problem: dict[str, Any], q: Sequence[Any], v: Sequence[Any], _of: Any) -> list[Any]:
    points = problem["points"]
    size, held = len(points[0]), set(problem["held"])
    free = {k: i for i, k in enumerate(k for k in range(len(points)) if k not in held)}
    places = [q[size * free[k] :][:size] if k in free else point for k, point in enumerate(points)]
    rates = [v[size * free[k] :][:size] if k in free else [0.0] * size for k in range(len(points))]
    rods = problem["rods"]
    u = [[b - a for a, b in zip(places[i], places[j], strict=True)] for i, j in rods]
    w = [[b - a for a, b in zip(rates[i], rates[j], strict=True)] for i, j in rods]
    # The rows of B have -u at i and u at j.
    S: dict[tuple[int, int], Any] = {}
    for row, ends in enumerate(rods):
        for other in range(row + 1):
            shared = [
                1.0 if (end == ends[1]) == (end == rods[other][1]) else -1.0
                for end in ends
                if end in rods[other] and end in free
            ]
            if shared:
                S[row, other] = _dot(u[row], u[other]) * sum(shared)
    right = []
    for row, (i, j) in enumerate(rods):
        pulls = (j in free) - (i in free)
        bias = -_dot(w[row], w[row])
        right.append(bias + u[row][-1] * (GRAVITY * pulls) if pulls else bias)
    lam = _solved(S, right)
    found: list[Any] = [-GRAVITY if c == size - 1 else 0.0 for _ in free for c in range(size)]
    for row, (i, j) in enumerate(rods):
        for end, sign in ((i, -1.0), (j, 1.0)):
            for c in range(size) if end in free else ():
                found[size * free[end] + c] = found[size * free[end] + c] + lam[row] * u[row][c] * sign
    return found


def _dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return sum((x * y for x, y in zip(a[1:], b[1:], strict=True)), a[0] * b[0])


def _solved(S: dict[tuple[int, int], Any], right: list[Any]) -> list[Any]:
    """x of S x = right, for S given by the entries of its lower half, which are changed."""
    n = len(right)
    x, inverse = list(right), list[Any]()
    for k in range(n):
        inverse.append(1.0 / S[k, k])
        below = [i for i in range(k + 1, n) if (i, k) in S]
        factor = {i: S[i, k] * inverse[k] for i in below}
        for i in below:
            for j in (j for j in below if j <= i):
                change = factor[i] * S[j, k]
                S[i, j] = S[i, j] - change if (i, j) in S else -change
            x[i] = x[i] - factor[i] * x[k]
        S.update({(i, k): factor[i] for i in below})
    for k in reversed(range(n)):
        x[k] = x[k] * inverse[k]
        for i in range(k + 1, n):
            if (i, k) in S:
                x[k] = x[k] - S[i, k] * x[i]
    return x


def _disk(problem: dict[str, Any], q: Sequence[Any], v: Sequence[Any], of: Any) -> list[Any]:
    """x, y, theta, phi: the rows x' = a sin(theta) phi', y' = -a cos(theta) phi'."""
    a, M = problem["a"], problem["M"]
    light, rolled = 1.0 / M, 1.0 / (M * a**2 / 2)
    s, c = a * of.sin(q[2]), a * of.cos(q[2])
    gamma = [c * v[2] * v[3], s * v[2] * v[3]]
    S = {(0, 0): light + s * s * rolled, (1, 0): -s * c * rolled, (1, 1): light + c * c * rolled}
    lam = _solved(S, gamma)
    return [lam[0] * light, lam[1] * light, 0.0 * v[2], (c * lam[1] - s * lam[0]) * rolled]
