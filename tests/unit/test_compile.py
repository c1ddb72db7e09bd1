"""The two ways of factoring S = B M^-1 B^T give the same functions."""

import pathlib

import numpy as np
import pytest

import lagcli
from lagcli import compiled, memory
from lagcli.compiled import numeric
from lagcli.equations import system

MODELS = pathlib.Path(__file__).parents[2] / "models"

# Cartesian, rheonomic, generalized with differential rows, rigid, and without any constraint.
NAMES = (
    "double-pendulum",
    "moving-ramp-stick",
    "rolling-disk",
    "knife-edge",
    "rigid-plate",
    "spring-triangle",
)


@pytest.fixture
def always_factored(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numeric, "EXPANDED_OPERATIONS", -1.0)
    memory.forget()


@pytest.mark.parametrize("name", NAMES)
def test_a_run_with_numeric_factors_equals_one_with_expanded_factors(name, always_factored, monkeypatch):
    model = lagcli.load(MODELS / f"{name}.yaml")
    factored = lagcli.simulate(model, duration=1.0, samples=11)
    monkeypatch.setattr(numeric, "EXPANDED_OPERATIONS", 3e5)
    memory.forget()
    expanded = lagcli.simulate(model, duration=1.0, samples=11)
    scale = np.abs(expanded.rows).max(axis=0) + 1.0
    assert np.abs((factored.rows - expanded.rows) / scale).max() < 1e-10
    assert factored.stats.velocity_drift < 1e-13


def test_large_systems_are_factored_numerically():
    """A grid of rods fills in as it is eliminated: its factors would not fit into a graph."""
    side = 12
    lines = ["lagcli: 1", "particles:"]
    lines += [f"  p{i}_{j}: {{mass: 1, position: [{i}, {j}, 0]}}" for i in range(side) for j in range(side)]
    lines += ["holonomic:"]
    pairs = [((i, j), (i + 1, j)) for i in range(side - 1) for j in range(side)]
    pairs += [((i, j), (i, j + 1)) for i in range(side) for j in range(side - 1)]
    lines += [f'  "r{a}_{b}_{c}_{d}": "distance(p{a}_{b}, p{c}_{d}) = 1"' for (a, b), (c, d) in pairs]
    built = system.build(lagcli.loads("\n".join(lines)))
    parts = compiled.parts.build(built)
    assert 3e4 < compiled.selection.operations(parts.S) < 3e6
    chain = system.build(lagcli.load(MODELS / "double-pendulum.yaml"))
    parts = compiled.parts.build(chain)
    assert compiled.selection.operations(parts.S) < 100


def test_particles_that_are_many_and_free_cost_no_memory_by_their_square():
    text = 'lagcli: 1\nparticles:\n  p[i]: {for: "i = 1..N", mass: 2, position: "[i, 0, 0]"}\nparameters: {N: 10000}\n'
    # M has as many entries as rows; its zeros alone would take gigabytes.
    assert lagcli.dof(lagcli.loads(text)).configuration_dof == 30_000
