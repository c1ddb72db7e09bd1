"""SymPy and SciPy: rows and biases derived as symbols, made functions by lambdify, solved by solve_ivp's DOP853.

With the argument `lagranges-method` the derivation is that of sympy.physics.mechanics.LagrangesMethod, for
chains; otherwise (D.24) is derived row by row, each row from the few symbols it holds, which is much faster.
"""

from __future__ import annotations

import csv
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import protocol
import sympy as sp
from scipy import integrate, sparse
from scipy.sparse import linalg
from sympy.physics import mechanics

DENSE_ROWS = 50

Rate = Callable[[float, Any], Any]
t = sp.Symbol("t")


class Law:
    """Symbols q, v; the diagonal of M, the forces F, and the rows: functions of q and t, or of q, v and t."""

    def __init__(self, size: int) -> None:
        self.q, self.v = sp.symbols(f"q:{size}", real=True), sp.symbols(f"v:{size}", real=True)
        self.mass, self.force = [1.0] * size, [sp.Integer(0)] * size
        self.f: list[Any] = []
        self.rows: list[Any] = []

    def derivative(self, f: Any) -> Any:
        """df/dt along the motion at fixed velocities."""
        index = {symbol: k for k, symbol in enumerate(self.q)}
        own = sorted(index[s] for s in f.free_symbols if s in index)
        return f.diff(t) + sum(f.diff(self.q[k]) * self.v[k] for k in own)


def network(problem: dict[str, Any]) -> tuple[Law, Any]:
    """Mass points and rods."""
    points = np.array(problem["points"])
    free = [k for k in range(len(points)) if k not in set(problem["held"])]
    law = Law(3 * len(free))
    places: list[Any] = [list(map(float, point)) for point in points]
    for i, k in enumerate(free):
        places[k] = law.q[3 * i : 3 * i + 3]
        law.force[3 * i + 2] = sp.Float(-protocol.GRAVITY)
    for i, j in problem["rods"]:
        length = float(np.linalg.norm(points[i] - points[j]))
        squares = sum((b - a) ** 2 for a, b in zip(places[i], places[j], strict=True))
        law.f.append((squares - length**2) / 2)
    return law, np.concatenate([points[free].ravel(), np.zeros(3 * len(free))])


def disk(problem: dict[str, Any]) -> tuple[Law, Any]:
    """x, y, theta, phi."""
    a, M = problem["a"], problem["M"]
    law = Law(4)
    law.mass = [M, M, M * a**2 / 4, M * a**2 / 2]
    theta, v = law.q[2], law.v
    law.rows = [v[0] - a * sp.sin(theta) * v[3], v[1] + a * sp.cos(theta) * v[3]]
    return law, np.array([0, 0, 0, 0, 0, -a * problem["spin"], problem["turn"], problem["spin"]])


def axis(problem: dict[str, Any]) -> tuple[Law, Any]:
    """xl, yl, xr, yr."""
    L, L0, r, w, m = (problem[name] for name in ("L", "L0", "r", "w", "m"))
    law = Law(4)
    law.mass = [m] * 4
    xl, yl, xr, yr = law.q
    yb = r * sp.sin(w * t)
    xb = sp.sqrt(L**2 - yb**2)
    left, right = sp.sqrt(xl**2 + yl**2), sp.sqrt((xr - xb) ** 2 + (yr - yb) ** 2)
    V = ((left - L0) ** 2 + (right - L0) ** 2) / 2 + m * problem["g"] * (yl + yr)
    law.force = [-V.diff(q) for q in law.q]
    law.f = [xl * xb + yl * yb, ((xl - xr) ** 2 + (yl - yr) ** 2 - L**2) / 2]
    return law, np.array([0, L0, L, L0, -L0 / L, 0, -L0 / L, 0])


def derived(law: Law) -> Rate:
    """y' of y = (q, v) by (D.24)."""
    rates = [*(law.derivative(f) for f in law.f), *law.rows]
    index = {symbol: k for k, symbol in enumerate(law.v)}
    entries = [
        (i, k, rate.diff(law.v[k]))
        for i, rate in enumerate(rates)
        for k in sorted(index[s] for s in rate.free_symbols if s in index)
    ]
    biases = [-law.derivative(rate) for rate in rates]
    wanted = [*(entry for _, _, entry in entries), *biases, *law.force]
    numbers = sp.lambdify((t, law.q, law.v), wanted, modules="math", cse=True)
    places = (np.array([i for i, _, _ in entries]), np.array([k for _, k, _ in entries]))
    n, count, ends = len(law.q), len(rates), (len(entries), len(entries) + len(rates))
    inverse = 1 / np.array(law.mass)
    is_dense = count <= DENSE_ROWS
    B: Any = np.zeros((count, n))

    def rate(time: float, y: Any) -> Any:
        found = np.array(numbers(time, y[:n].tolist(), y[n:].tolist()))
        free = inverse * found[ends[1] :]
        if is_dense:
            B[places] = found[: ends[0]]
            lam = np.linalg.solve((B * inverse) @ B.T, found[ends[0] : ends[1]] - B @ free)
            return np.concatenate([y[n:], free + inverse * (lam @ B)])
        rows = sparse.csr_matrix((found[: ends[0]], places), shape=(count, n))
        S = (rows @ sparse.diags(inverse) @ rows.T).tocsc()
        lam = linalg.splu(S, permc_spec="MMD_AT_PLUS_A").solve(found[ends[0] : ends[1]] - rows @ free)
        return np.concatenate([y[n:], free + inverse * (rows.T @ lam)])

    return rate


def lagranges_method(law: Law) -> Rate:
    """y' by the class of SymPy, its matrices solved as numbers."""
    q = mechanics.dynamicsymbols(f"q:{len(law.q)}")
    v = [coordinate.diff(mechanics.dynamicsymbols._t) for coordinate in q]
    T = sum(m * rate**2 for m, rate in zip(law.mass, v, strict=True)) / 2
    V = -sum(F * coordinate for F, coordinate in zip(law.force, q, strict=True))
    names = dict(zip(law.q, q, strict=True))
    method = mechanics.LagrangesMethod(T - V, q, hol_coneqs=[f.xreplace(names) for f in law.f])
    method.form_lagranges_equations()
    u = sp.symbols(f"u:{len(q)}")
    values = {**dict(zip(v, u, strict=True)), **dict(zip(q, law.q, strict=True))}
    matrices = [part.xreplace(values) for part in (method.mass_matrix_full, method.forcing_full)]
    numbers = sp.lambdify((law.q, u), matrices, modules="numpy", cse=True)
    n = len(q)

    def rate(_time: float, y: Any) -> Any:
        matrix, right = numbers(y[:n], y[n:])
        return np.linalg.solve(matrix, right.ravel())[: 2 * n]

    return rate


BUILDERS = {"network": network, "disk": disk, "axis": axis}


def solve(rate: Rate, start: Any, duration: float, tolerance: float, rows: int) -> Any:
    """The result of solve_ivp."""
    times = np.linspace(0, duration, rows)
    return integrate.solve_ivp(
        rate, (0, duration), start, method="DOP853", t_eval=times, rtol=tolerance, atol=tolerance
    )


def settings(rate: Rate, start: Any, duration: float) -> Iterator[tuple[str, protocol.Run]]:
    """Runs with ever smaller tolerances."""
    for half_decades in range(10, 28):
        tolerance = 10 ** (-half_decades / 2)

        def run(tolerance: float = tolerance) -> tuple[float, Any]:
            began = time.perf_counter()
            found = solve(rate, start, duration, tolerance, 2)
            return time.perf_counter() - began, found.y[: len(start) // 2, -1]

        yield f"tolerances {tolerance:.0e}", run


def main() -> None:
    """Answer one request."""
    asked = protocol.request()
    problem = asked["problem"]
    began = time.perf_counter()
    law, start = BUILDERS[problem["kind"]](problem)
    derive = lagranges_method if "lagranges-method" in sys.argv[1:] else derived
    rate = derive(law)
    build_seconds = time.perf_counter() - began
    if "whole" in asked:
        whole = asked["whole"]
        found = solve(rate, start, problem["duration"], whole["tolerance"], whole["rows"])
        with open(whole["file"], "w", newline="") as file:
            csv.writer(file).writerows(np.column_stack([found.t, found.y.T]).tolist())
        return
    protocol.Search(asked, build_seconds).first(settings(rate, start, problem["duration"]))


if __name__ == "__main__":
    main()
