"""Points of rest of large models, by sparse algebra: a chain of fifty links between two hooks."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize

import lagcli

pytestmark = pytest.mark.numeric

N, L, SPAN, MASS, G = 50, 0.02, 0.6, 0.01, 9.81
CATENARY = f"""
lagcli: 1
parameters: {{L: {L}, m: {MASS}, g: {G}, half: 0.4}}
particles:
  p[i]: {{for: "i = 1..{N - 1}", mass: m, position: "[i*{SPAN}/{N}, 0.02*sin(i), -half*sin(pi*i/{N})]"}}
forces:
  weight: {{to: p, force: [0, 0, -m*g]}}
holonomic:
  first: norm(p[1]) = L
  link[i]: {{for: "i = 2..{N - 1}", equation: "distance(p[i-1], p[i]) = L"}}
  last: distance(p[{N - 1}], [{SPAN}, 0, 0]) = L
"""


def hanging() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x and z of the joints and the tension of the links: H alike in all, and what hangs below on either side."""
    upright = (np.arange(N) - (N - 1) / 2) * MASS * G

    def span(H: float) -> float:
        return float((L * H / np.hypot(H, upright)).sum() - SPAN)

    H = optimize.brentq(span, 1e-3, 10.0, xtol=1e-15, rtol=1e-14)
    tension = np.hypot(H, upright)
    return np.cumsum(L * H / tension)[:-1], np.cumsum(L * upright / tension)[:-1], tension


def test_a_chain_of_fifty_links_hangs_as_a_catenary() -> None:
    """All joints, and the tension of every link, from a start that is not on the links and sways aside."""
    found = lagcli.equilibrium(lagcli.loads(CATENARY), starts=0)
    x, z, tension = hanging()
    lowest = next(point for point in found if point.type == "minimum")
    for axis, wanted in (("x", x), ("y", 0 * x), ("z", z)):
        values = np.array([lowest.at[f"p[{i}].{axis}"] for i in range(1, N)])
        np.testing.assert_allclose(values, wanted, atol=1e-11)
    names = ["first", *(f"link[{i}]" for i in range(2, N)), "last"]
    # Equations of norms: a rod that pulls has lambda below zero.
    np.testing.assert_allclose([-lowest.multipliers[name] for name in names], tension, rtol=1e-10)
    assert lowest.unique_multipliers
    assert lowest.residual < 1e-12
