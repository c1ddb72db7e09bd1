"""CasADi's CVODES on equations written by hand: the index-1 form of (D.24), lambda eliminated, no projection.

Adams formulas with functional iteration, which suits these problems that are not stiff; the first tolerance that
reaches the wanted error.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Any

import casadi as ca
import numpy as np
import protocol

# Beyond this many components the Jacobian of y', which this iteration does not use, takes CasADi minutes to set up.
LARGEST_JACOBIAN = 200
# Beyond this fill of the factors, S is factored at each call instead of in the graph.
EXPANDED_FILL = 20


def network(problem: dict[str, Any]) -> tuple[dict[str, Any], Any]:
    """y' of y = (x, v) of the free points, and the start."""
    points = np.array(problem["points"])
    free = [k for k in range(len(points)) if k not in set(problem["held"])]
    place = {k: i for i, k in enumerate(free)}
    x, v = ca.SX.sym("x", 3 * len(free)), ca.SX.sym("v", 3 * len(free))

    def position(k: int) -> Any:
        return x[3 * place[k] : 3 * place[k] + 3] if k in place else ca.SX(ca.DM(points[k]))

    lengths = [float(np.linalg.norm(points[i] - points[j])) for i, j in problem["rods"]]
    rods = [position(j) - position(i) for i, j in problem["rods"]]
    f = ca.vertcat(*[(ca.dot(u, u) - length**2) / 2 for u, length in zip(rods, lengths, strict=True)])
    B = ca.jacobian(f, x)
    gamma = -ca.jtimes(B @ v, x, v)
    F = ca.repmat(ca.DM([0, 0, -protocol.GRAVITY]), len(free), 1)
    start = np.concatenate([points[free].ravel(), np.zeros(3 * len(free))])
    S, right = B @ B.T, ca.densify(gamma - B @ F)
    y = ca.vertcat(x, v)
    if S.sparsity().ldl()[0].nnz() <= EXPANDED_FILL * S.size1():
        D, LT, order = ca.ldl(S)
        lam = ca.ldl_solve(right, D, LT, order)
        return {"x": y, "ode": ca.vertcat(v, F + B.T @ lam)}, start
    mu, state = ca.SX.sym("mu", S.size1()), ca.MX.sym("y", y.numel())
    before = ca.Function("before", [y], [S, right])
    after = ca.Function("after", [y, mu], [ca.vertcat(v, F + B.T @ mu)])
    return {"x": state, "ode": after(state, ca.solve(*before(state), "ldl"))}, start


def _index_1(q: Any, v: Any, law: tuple[Any, Any, Any, Any], t: Any) -> dict[str, Any]:
    """y' of y = (q, v) for (M, F, B, b): the diagonal of M, forces, rows B v + b = 0."""
    M, F, B, b = law
    rows = B @ v + b
    gamma = -(ca.jtimes(rows, q, v) + ca.jacobian(rows, t))
    free = F / M
    lam = ca.solve(B @ ca.diag(1 / M) @ B.T, gamma - B @ free)
    return {"x": ca.vertcat(q, v), "t": t, "ode": ca.vertcat(v, free + (B.T @ lam) / M)}


def disk(problem: dict[str, Any]) -> tuple[dict[str, Any], Any]:
    """x, y, theta, phi."""
    a, M = problem["a"], problem["M"]
    q, v, t = ca.SX.sym("q", 4), ca.SX.sym("v", 4), ca.SX.sym("t")
    rows = ca.vertcat(v[0] - a * ca.sin(q[2]) * v[3], v[1] + a * ca.cos(q[2]) * v[3])
    mass = ca.SX(ca.DM([M, M, M * a**2 / 4, M * a**2 / 2]))
    start = np.array([0, 0, 0, 0, 0, -a * problem["spin"], problem["turn"], problem["spin"]])
    return _index_1(q, v, (mass, ca.SX(4, 1), ca.jacobian(rows, v), ca.SX(2, 1)), t), start


def axis(problem: dict[str, Any]) -> tuple[dict[str, Any], Any]:
    """xl, yl, xr, yr."""
    L, L0, r, w, m = (problem[name] for name in ("L", "L0", "r", "w", "m"))
    q, v, t = ca.SX.sym("q", 4), ca.SX.sym("v", 4), ca.SX.sym("t")
    left, right = q[:2], q[2:]
    yb = r * ca.sin(w * t)
    road = ca.vertcat(ca.sqrt(L**2 - yb**2), yb)
    f = ca.vertcat(ca.dot(left, road), (ca.sumsqr(left - right) - L**2) / 2)
    springs = ((ca.norm_2(left) - L0) ** 2 + (ca.norm_2(right - road) - L0) ** 2) / 2
    V = springs + m * problem["g"] * (q[1] + q[3])
    law = (ca.SX(ca.DM([m] * 4)), -ca.gradient(V, q), ca.jacobian(f, q), ca.jacobian(f, t))
    return _index_1(q, v, law, t), np.array([0, L0, L, L0, -L0 / L, 0, -L0 / L, 0])


BUILDERS = {"network": network, "disk": disk, "axis": axis}


class Opaque(ca.Callback):
    """y' as a function whose Jacobian is declared empty: functional iteration never asks for it."""

    def __init__(self, ode: dict[str, Any]) -> None:
        ca.Callback.__init__(self)
        self._size = ode["x"].numel()
        self._rate = ca.Function("rate", [ode["x"]], [ode["ode"]])
        self.construct("opaque", {})

    def get_sparsity_in(self, _i: int) -> Any:
        return ca.Sparsity.dense(self._size, 1)

    def get_sparsity_out(self, _i: int) -> Any:
        return ca.Sparsity.dense(self._size, 1)

    def eval(self, arguments: Sequence[Any]) -> list[Any]:
        return [self._rate(arguments[0])]

    def has_jac_sparsity(self, _output: int, _input: int) -> bool:
        return True

    def get_jac_sparsity(self, _output: int, _input: int, _symmetric: bool) -> Any:
        return ca.Sparsity(self._size, self._size)

    def has_jacobian(self) -> bool:
        return True

    def get_jacobian(self, name: str, inputs: Sequence[str], outputs: Sequence[str], options: Any) -> Any:
        y, rate = ca.MX.sym("y", self._size), ca.MX.sym("rate", self._size)
        return ca.Function(name, [y, rate], [ca.MX(self._size, self._size)], inputs, outputs, options)


def settings(ode: dict[str, Any], start: Any, duration: float) -> Iterator[tuple[str, protocol.Run]]:
    """Runs with ever smaller tolerances."""
    for half_decades in range(10, 29):
        tolerance = 10 ** (-half_decades / 2)
        solver = ca.integrator(
            "solver",
            "cvodes",
            ode,
            0.0,
            duration,
            {
                "reltol": tolerance,
                "abstol": tolerance,
                "linear_multistep_method": "adams",
                "nonlinear_solver_iteration": "functional",
                "max_num_steps": 10**8,
            },
        )

        def run(solver: Any = solver) -> tuple[float, Any]:
            began = time.perf_counter()
            end = solver(x0=start)["xf"]
            seconds = time.perf_counter() - began
            return seconds, np.array(end).ravel()[: len(start) // 2]

        yield f"Adams, tolerances {tolerance:.0e}", run


def main() -> None:
    """Answer one request."""
    asked = protocol.request()
    began = time.perf_counter()
    ode, start = BUILDERS[asked["problem"]["kind"]](asked["problem"])
    if ode["x"].numel() > LARGEST_JACOBIAN:
        opaque, state = Opaque(ode), ca.MX.sym("y", ode["x"].numel())
        ode = {"x": state, "ode": opaque(state)}
    search = protocol.Search(asked, time.perf_counter() - began)
    search.first(settings(ode, start, asked["problem"]["duration"]))


if __name__ == "__main__":
    main()
