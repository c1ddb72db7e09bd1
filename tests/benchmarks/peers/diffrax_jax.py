"""diffrax: Runge-Kutta schemes of order 5 (Tsit5) and 8 (Dopri8) in doubles, compiled by XLA."""

from __future__ import annotations

import sys
import time
from typing import Any

import diffrax
import equations
import jax
import jax.numpy as jnp
import numpy as np
import protocol

jax.config.update("jax_enable_x64", True)
# JAX computes in threads whose times the system counts late.
protocol.clock = time.perf_counter


# Beyond, equations number by number take XLA longer than equations of arrays.
MANY_RODS = 5


def by_arrays(problem: dict[str, Any], q: Any, v: Any) -> Any:
    """The accelerations of a chain that hangs at its first point: its matrix S is tridiagonal."""
    size = len(problem["points"][0])
    x, w = (jnp.concatenate([jnp.zeros((1, size)), each.reshape(-1, size)]) for each in (q, v))
    u, du = jnp.diff(x, axis=0), jnp.diff(w, axis=0)
    zero = jnp.zeros(1)
    beside = -jnp.sum(u[1:] * u[:-1], axis=1)
    diagonal = jnp.sum(u * u, axis=1) * jnp.full(len(u), 2.0).at[0].set(1.0)
    right = -jnp.sum(du * du, axis=1).at[0].add(-equations.GRAVITY * u[0, -1])
    lower, upper = jnp.concatenate([zero, beside]), jnp.concatenate([beside, zero])
    pulls = jax.lax.linalg.tridiagonal_solve(lower, diagonal, upper, right[:, None]) * u
    weight = jnp.zeros(size).at[-1].set(-equations.GRAVITY)
    return (weight + pulls - jnp.concatenate([pulls[1:], jnp.zeros((1, size))])).ravel()


def build(problem: dict[str, Any]) -> protocol.Solver:
    """The equations as a function that is traced."""
    q0, v0 = equations.start(problem)
    n, start = len(q0), jnp.asarray(np.concatenate([q0, v0]))

    def rate(_t: Any, y: Any, _arguments: Any) -> Any:
        if len(problem.get("rods", ())) > MANY_RODS:
            return jnp.concatenate([y[n:], by_arrays(problem, y[:n], y[n:])])
        found = equations.accelerations(problem, [y[i] for i in range(n)], [y[n + i] for i in range(n)], jnp)
        return jnp.concatenate([y[n:], jnp.stack(found)])

    def solution(tolerance: Any, y: Any) -> Any:
        control = diffrax.PIDController(rtol=tolerance, atol=tolerance)
        ends = (0.0, problem["duration"], None)
        # No derivatives are wanted, and the loop needs no memory of its steps; without exceptions from within, JAX
        # can keep what it compiled.
        saved = {
            "saveat": diffrax.SaveAt(t1=True),
            "adjoint": diffrax.ForwardMode(),
            "max_steps": 10**6,
            "throw": False,
        }
        scheme = getattr(diffrax, sys.argv[1])()
        found = diffrax.diffeqsolve(
            diffrax.ODETerm(rate), scheme, *ends, y, stepsize_controller=control, **saved
        )
        return found.ys[0, :n]

    compiled = jax.jit(solution)

    def prepare(setting: str) -> protocol.Run:
        return lambda: compiled(float(setting), start).block_until_ready()

    return protocol.Solver(protocol.tolerances(4, 14), prepare)


if __name__ == "__main__":
    protocol.serve(build)
