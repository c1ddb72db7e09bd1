"""heyoka: Taylor series of adaptive order, compiled by LLVM; compact mode is compiled sooner and runs slower."""

from __future__ import annotations

import sys
from typing import Any

import equations
import heyoka as hy
import numpy as np
import protocol

# Without compact mode the equations of so many coordinates are compiled for tens of seconds, for each tolerance anew.
MANY = 20


def build(problem: dict[str, Any]) -> protocol.Solver:
    """The equations as expressions."""
    is_compact = sys.argv[1] == "compact"
    q0, v0 = equations.start(problem)
    q, v = ([hy.expression(f"{letter}{i}") for i in range(len(q0))] for letter in "qv")
    system = [*zip(q, v, strict=True), *zip(v, equations.accelerations(problem, q, v, hy), strict=True)]
    state = np.concatenate([q0, v0])

    def prepare(setting: str) -> protocol.Run:
        integrator = hy.taylor_adaptive(system, state, tol=float(setting), compact_mode=is_compact)

        def run() -> Any:
            integrator.time = 0.0
            integrator.state[:] = state
            integrator.propagate_until(problem["duration"])
            return integrator.state[: len(q0)].copy()

        return run

    is_long = len(q0) > MANY and not is_compact
    return protocol.Solver(["1e-06", "1e-09", "1e-12"] if is_long else protocol.tolerances(5, 15, 2), prepare)


if __name__ == "__main__":
    protocol.serve(build)
