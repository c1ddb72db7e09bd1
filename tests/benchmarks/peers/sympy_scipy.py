"""SymPy and SciPy: rows and biases derived as symbols, made functions by lambdify, solved by solve_ivp's DOP853.

(D.24) is derived row by row, each row from the few symbols it holds. Nothing is projected.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import equations
import numpy as np
import protocol
import sympy as sp
from scipy import integrate

Rate = Callable[[float, Any], Any]


class Law:
    """Symbols q, v; the diagonal of M, the forces F, and the rates of the rows, linear in v."""

    def __init__(self, size: int) -> None:
        self.q, self.v = sp.symbols(f"q:{size}", real=True), sp.symbols(f"v:{size}", real=True)
        self.mass, self.force = [1.0] * size, [0.0] * size
        self.rates: list[Any] = []

    def derivative(self, f: Any) -> Any:
        """df/dt along the motion at fixed velocities."""
        rates = dict(zip(self.q, self.v, strict=True))
        return sum(f.diff(q) * rates[q] for q in sorted(f.free_symbols & set(self.q), key=str))


def network(problem: dict[str, Any]) -> Law:
    """Mass points and rods."""
    points = problem["points"]
    free = [k for k in range(len(points)) if k not in set(problem["held"])]
    size = len(points[0])
    law = Law(size * len(free))
    places: list[Any] = list(points)
    for i, k in enumerate(free):
        places[k] = law.q[size * i :][:size]
        law.force[size * i + size - 1] = -equations.GRAVITY
    for i, j in problem["rods"]:
        square = sum((b - a) ** 2 for a, b in zip(places[i], places[j], strict=True))
        law.rates.append(law.derivative(square / 2))
    return law


def disk(problem: dict[str, Any]) -> Law:
    """x, y, theta, phi."""
    a, M = problem["a"], problem["M"]
    law = Law(4)
    law.mass = [M, M, M * a**2 / 4, M * a**2 / 2]
    theta, v = law.q[2], law.v
    law.rates = [v[0] - a * sp.sin(theta) * v[3], v[1] + a * sp.cos(theta) * v[3]]
    return law


def derived(law: Law) -> Rate:
    """y' of y = (q, v) by (D.24)."""
    index = {symbol: k for k, symbol in enumerate(law.v)}
    entries = [
        (i, k, rate.diff(law.v[k]))
        for i, rate in enumerate(law.rates)
        for k in sorted(index[s] for s in rate.free_symbols if s in index)
    ]
    wanted = [*(entry for _, _, entry in entries), *(-law.derivative(rate) for rate in law.rates)]
    numbers = sp.lambdify((law.q, law.v), wanted, modules="math", cse=True)
    places = (np.array([i for i, _, _ in entries]), np.array([k for _, k, _ in entries]))
    n, inverse = len(law.q), 1 / np.array(law.mass)
    free, B = inverse * np.array(law.force), np.zeros((len(law.rates), n))

    def rate(_time: float, y: Any) -> Any:
        found = np.array(numbers(y[:n].tolist(), y[n:].tolist()))
        B[places] = found[: len(entries)]
        lam = np.linalg.solve((B * inverse) @ B.T, found[len(entries) :] - B @ free)
        return np.concatenate([y[n:], free + inverse * (lam @ B)])

    return rate


BUILDERS = {"network": network, "disk": disk}


def build(problem: dict[str, Any]) -> protocol.Solver:
    """The equations as functions of Python."""
    law = BUILDERS[problem["kind"]](problem)
    rate, ends = derived(law), (0.0, problem["duration"])
    start = np.concatenate(equations.start(problem))

    def prepare(setting: str) -> protocol.Run:
        accuracy = {"rtol": float(setting), "atol": float(setting)}
        return lambda: integrate.solve_ivp(rate, ends, start, method="DOP853", **accuracy).y[: len(law.q), -1]

    # `solve_ivp` takes no finer ones.
    return protocol.Solver(protocol.tolerances(4, 13), prepare)


if __name__ == "__main__":
    protocol.serve(build)
