"""Runs that stay at rest: nothing has a size there but the forces that balance, and their rounding is no motion."""

from __future__ import annotations

import dataclasses
import pathlib

import casadi as ca
import numpy as np
import pytest

import lagcli
from lagcli.equations import operation_rules, system
from lagcli.model.model import Model

pytestmark = pytest.mark.numeric

MODELS = pathlib.Path(__file__).parents[2] / "models"
# Balanced by rows, by rows that are redundant, by springs within h, on a turning hoop, and nonholonomic rows.
RESTING = [
    "three-bar-truss", "double-four-bar", "braced-square", "triangle-on-sphere", "four-legged-table",
    "buckling-column", "co2-vibrations", "bead-on-rotating-hoop", "two-wheel-axle", "zeno-ball",
]  # fmt: skip


def resting(name: str) -> Model:
    """A model that starts at the first point of rest that is found."""
    model = lagcli.load(MODELS / f"{name}.yaml")
    at = lagcli.equilibrium(model, starts=2)[0].at
    q = np.array([at[column] for column in model.coordinate_names])
    there = system.started_at(model, q, np.zeros_like(q))
    return dataclasses.replace(there, simulation=dataclasses.replace(there.simulation, assemble=True))


@pytest.fixture(scope="module", params=RESTING)
def model(request: pytest.FixtureRequest) -> Model:
    return resting(request.param)


def test_a_body_at_rest_takes_few_steps_and_is_balanced(model: Model) -> None:
    """Rounding is no error of a step: it was rejected, and steps shrank until it fitted in."""
    stats = lagcli.simulate(model).stats
    assert stats.rejected <= 3
    assert stats.steps <= 40
    # Rounding over rounding came near 1.
    assert stats.energy_imbalance is not None
    assert stats.energy_imbalance < 1e-4


def test_the_audit_of_a_body_at_rest_passes(model: Model) -> None:
    found = lagcli.audit(model)
    assert found.passed, [(check.name, check.worst) for check in found.checks if check.verdict == "fail"]


@pytest.mark.parametrize("column", ["joint.vz", "R.joint.x", "lambda.bar1"])
def test_an_error_in_a_table_of_a_body_at_rest_is_found(column: str, tmp_path: pathlib.Path) -> None:
    model = lagcli.load(MODELS / "three-bar-truss.yaml")
    run = lagcli.simulate(model)
    rows = run.rows.copy()
    rows[4, run.columns.index(column)] += 1e-7
    table = tmp_path / "wrong.csv"
    np.savetxt(table, rows, "%.17g", ",", header=",".join(run.columns), comments="")
    assert not lagcli.audit(model, table).passed


def test_sizes_of_terms_are_those_that_cancel() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    value = ca.vertcat(
        9.81 * x - 9.8099999999 * x,
        ca.sin(y),
        (x - 3) * 1e6,
        ca.sqrt((x - 3) ** 2) / (x + 1),
        -2 * (x - y),
        y**2,
    )
    sizes = ca.Function("sizes", [x, y], [operation_rules.term_sizes(value, [x, y])])
    found = np.array(sizes(3.0, np.pi)).ravel()
    least = [9.81 * 3, 1.0, 3e6, 1.0, 2 * np.pi, np.pi**2]
    assert (found >= np.array(least) * (1 - 1e-12)).all()
    assert (found <= 10 * np.array(least)).all()


def test_contacts_that_share_a_load_at_the_origin_do_not_contradict_each_other() -> None:
    """Nothing has a size there but the weight: the velocities of four legs were rounding beside rounding."""
    run = lagcli.simulate(
        lagcli.loads("""
lagcli: 1
coordinates: {z: {}, a: {}, b: {}}
lagrangian: (rate(z)**2 + rate(a)**2 + rate(b)**2)/2 - 10*z
inequality:
  ne: z + a + b >= 0
  nw: z - a + b >= 0
  sw: z - a - b >= 0
  se: z + a - b >= 0
simulation: {duration: 1, samples: 3}
""")
    )
    assert run.stats.stopped is None
    for name in ("ne", "nw", "sw", "se"):
        np.testing.assert_allclose(run[f"lambda.{name}"], 2.5, rtol=1e-12)
