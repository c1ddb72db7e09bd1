"""The potential whose stationary points are the points of rest, where the forces have one."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from lagcli.statics.static_problem import StaticProblem

Floats = npt.NDArray[np.float64]
Origin = Literal["declared", "integrated", "none"]

# Parts of the forces, and of their gradients, that are rounding; and places that are looked at.
NOTHING, SYMMETRIC = 1e-11, 1e-10
PLACES = (0.0, 0.1, 0.5, 1.0, 2.0)


def origin(problem: StaticProblem) -> Origin:
    """The potential of the forces at rest: as declared, of forces that have one by their gradient, or none.

    Functions are told from zero by their values at random places.
    """
    random = np.random.default_rng(7)
    size = float(np.abs(problem.begin).max(initial=0.0)) or 1.0
    found: Origin = "declared"
    for part in PLACES:
        q = problem.begin + part * size * random.standard_normal(problem.n)
        driving, gradient = problem.driving(q)
        F = problem.at(problem.t, q, problem.nothing).F
        if not np.isfinite(driving).all() or not np.isfinite(gradient).all():
            continue
        largest = np.abs(F).max(initial=0.0)
        if np.abs(driving).max(initial=0.0) > NOTHING * max(largest, 1e-300):
            found = "integrated"
        if np.abs(gradient - gradient.T).max(initial=0.0) > SYMMETRIC * np.abs(gradient).max(initial=0.0):
            return "none"
    return found


def value(problem: StaticProblem, source: Origin, q: Floats) -> float | None:
    """The potential at q; of forces without a declared one less their work from the start, along a straight way."""
    if source == "none":
        return None
    declared = problem.value(q)
    if source == "declared":
        return declared + 0.0
    from scipy import integrate

    way = q - problem.begin

    def along(part: float) -> float:
        return float(problem.driving(problem.begin + part * way)[0] @ way)

    work, error = integrate.quad(along, 0.0, 1.0, epsabs=0.0, epsrel=1e-12, limit=200)[:2]
    return declared - work if np.isfinite(work) and error <= 1e-9 * max(1.0, abs(work)) else None
