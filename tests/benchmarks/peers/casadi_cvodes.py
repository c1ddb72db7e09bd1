"""CasADi's CVODES: Adams formulas with functional iteration, which suits these problems that are not stiff."""

from __future__ import annotations

from typing import Any

import casadi as ca
import equations
import numpy as np
import protocol

OPTIONS = {
    "linear_multistep_method": "adams",
    "nonlinear_solver_iteration": "functional",
    "max_num_steps": 10**8,
}


def build(problem: dict[str, Any]) -> protocol.Solver:
    """The equations as a graph of CasADi."""
    start = np.concatenate(equations.start(problem))
    n = len(start) // 2
    y = ca.SX.sym("y", 2 * n)
    found = equations.accelerations(problem, ca.vertsplit(y[:n]), ca.vertsplit(y[n:]), ca)
    ode = {"x": y, "ode": ca.vertcat(y[n:], *found)}

    def prepare(setting: str) -> protocol.Run:
        accuracy = {"reltol": float(setting), "abstol": float(setting)}
        solver = ca.integrator("solver", "cvodes", ode, 0.0, problem["duration"], OPTIONS | accuracy)
        return lambda: np.array(solver(x0=start)["xf"]).ravel()[:n]

    return protocol.Solver(protocol.tolerances(5, 14), prepare)


if __name__ == "__main__":
    protocol.serve(build)
