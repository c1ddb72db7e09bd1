"""The numbers of walks over a surface and of proofs by second derivatives: on either side of each another course."""

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

import lagcli
from lagcli.analysis.codimension import manifold, scaled_equations, second_order
from lagcli.api import cache
from lagcli.linear.metric_rows import LocalRows
from lagcli.start import initial

# Walks over a manifold


def test_a_step_over_a_manifold_is_a_half_at_first():
    def line(z, t):
        return np.zeros(1), np.array([[1.0, 0.0]])

    there = manifold.along(line, 0.0, np.zeros(2), 0.0, 1).step(np.zeros(2), 0.0, np.ones(2))
    assert np.abs(there).max() == pytest.approx(0.5, rel=1e-12)


# Units


def particle_part(*laws):
    rows = "".join(f"  r{i}: {law} = 0\n" for i, law in enumerate(laws))
    text = f"lagcli: 1\nparticles: {{a: {{mass: 1, position: [0, 0, 0]}}}}\nholonomic:\n{rows}"
    model = cache.compiled(lagcli.loads(text))
    state = initial.declared(model.system)
    return scaled_equations.part(model.system, model.numeric, state, list(range(len(laws))))


@pytest.mark.parametrize(("radius", "is_unit"), [(3e-4, True), (3e-5, False)])
def test_a_radius_of_curvature_is_a_unit_down_to_four_digits(radius, is_unit):
    unit = particle_part(f"a.x + a.z**2/(2*{radius!r})").unit
    assert unit == pytest.approx(np.full(2, radius if is_unit else 1.0), rel=1e-6)


@pytest.mark.parametrize(("jump", "answer"), [(3e-7, True), (3e-6, False)])
def test_a_gradient_jumps_by_more_than_roundings_of_the_coordinates(jump, answer):
    mixed = np.random.default_rng(scaled_equations.SEED).standard_normal(1)

    def at(z, t):
        return np.zeros(1), LocalRows(ca.DM([[1.0 + jump / mixed[0] * bool(z[0])]]))

    part = SimpleNamespace(
        coordinates=[0],
        rows=[0],
        begin=np.zeros(1),
        state=SimpleNamespace(t=0.0),
        hessian_entries=lambda z, t, w: (np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp), np.zeros(0)),
        entries_at=at,
        rounding=1e-8,
    )
    assert scaled_equations.is_smooth(part) is answer


# Second derivatives


class Centers:
    """Minima of the barrier, with the same least eigenvalue at every weight."""

    def __init__(self, eigenvalue):
        self.eigenvalue, self.weights = eigenvalue, []

    def __call__(self, matrices, x, weight):
        self.weights.append(weight)
        return np.array([1.0, self.eigenvalue])


def test_the_weight_of_the_barrier_grows_by_eight(monkeypatch):
    centers = Centers(0.0)
    monkeypatch.setattr(second_order, "_centered", centers)
    assert second_order.definite_combination(np.ones((1, 1, 1))) is None
    assert centers.weights == [8.0**k for k in range(9)]  # 2 / 8**8 is the first below a millionth


@pytest.mark.parametrize(("eigenvalue", "centers"), [(0.15, 3), (0.09, 4)])
def test_a_combination_is_known_to_a_third_of_its_least_eigenvalue(eigenvalue, centers, monkeypatch):
    found = Centers(eigenvalue)
    monkeypatch.setattr(second_order, "_centered", found)
    assert second_order.definite_combination(np.ones((1, 1, 1))) is not None
    # It is known to 2, 1/4, 1/32, 1/256.
    assert len(found.weights) == centers


def barrier(decrement, falls=True):
    """A barrier whose Newton steps promise so much, and that falls by it or not at all; `calls` are its values."""
    calls = []

    def value(matrices, x, weight):
        calls.append(x)
        found = -2.0 * len(calls), np.array([decrement**0.5]), np.eye(1)
        return found if falls or len(calls) == 1 else None

    return value, calls


@pytest.mark.parametrize(
    ("decrement", "falls", "values"),
    [(1.0, True, 1 + 40), (1.0, False, 1 + 30), (3e-4, True, 1), (3e-3, True, 41)],
)
def test_newton_steps_to_the_minimum_of_the_barrier(decrement, falls, values, monkeypatch):
    value, calls = barrier(decrement, falls)
    monkeypatch.setattr(second_order, "_barrier", value)
    second_order._centered(np.ones((1, 1, 1)), np.zeros(1), 1.0)
    assert len(calls) == values
