"""`audit` of points of rest: right ones pass, and each fault is found by the check it belongs to."""

import numpy as np
import pytest

import lagcli
from lagcli.output.tables import sinks

HEAD = "lagcli: 1\n"
WEIGHT = "forces:\n  weight: {to: all, force: [0, 0, -9.81*m]}\n"
MODELS = {
    "pendulum": "particles:\n  a: {mass: 2, position: [0.6, 0, -0.8]}\nholonomic:\n  rod: norm(a) = 1\n"
    + WEIGHT,
    "hoop": """parameters: {W: 6, R: 0.5}
coordinates:
  th: {value: 0.9}
particles:
  bead: {mass: 1, position: "[R*sin(th)*cos(W*t), R*sin(th)*sin(W*t), -R*cos(th)]"}
"""
    + WEIGHT,
    "floor": "particles:\n  a: {mass: 1, position: [0, 0, 1]}\ninequality:\n  floor: a.z >= 0.5\n" + WEIGHT,
    "follower": (
        "coordinates:\n  th: {value: 0.1}\nparticles:\n  a: {mass: 1, position: [sin(th), 0, -cos(th)]}\n"
        + WEIGHT
        + "  across: {to: th, force: 4.905}\n"
    ),
}


def written(model, path):
    found = lagcli.equilibrium(model, starts=2)
    numbers, types = found.table()
    with sinks.open_sink(path, (*found.columns, "type"), texts=("type",)) as sink:
        sink.write(numbers, [types])
    return found.columns, numbers, types


@pytest.mark.parametrize("name", MODELS)
def test_points_of_rest_pass(name, tmp_path):
    model = lagcli.loads(HEAD + MODELS[name])
    written(model, tmp_path / "points.csv")
    audit = lagcli.audit(model, tmp_path / "points.csv")
    assert audit.passed, audit
    assert all(check.judged == check.entries for check in audit.checks)


@pytest.mark.parametrize(
    ("name", "column", "change", "check"),
    [
        ("pendulum", "a.z", 1e-6, "places"),
        ("pendulum", "lambda.rod", 1e-6, "equilibrium"),
        ("pendulum", "R.a.z", 1e-6, "reactions"),
        ("hoop", "th", 1e-4, "equilibrium"),
        ("hoop", "R.bead.x", 1e-3, "reactions"),
        ("follower", "th", 1e-6, "equilibrium"),
        ("floor", "a.z", -1e-6, "signorini"),
        ("floor", "lambda.floor", -1e-5, "equilibrium"),
    ],
)
def test_a_fault_is_found(name, column, change, check, tmp_path):
    model = lagcli.loads(HEAD + MODELS[name])
    columns, numbers, types = written(model, tmp_path / "points.csv")
    numbers[0, list(columns).index(column)] += change
    with sinks.open_sink(tmp_path / "wrong.csv", (*columns, "type"), texts=("type",)) as sink:
        sink.write(numbers, [types])
    audit = lagcli.audit(model, tmp_path / "wrong.csv")
    assert not audit.passed
    assert audit.check(check).verdict == "fail"
    assert audit.conclusion.endswith("the table does not hold points of rest of this model.")


def test_a_point_on_the_hoop_where_nothing_rests(tmp_path):
    model = lagcli.loads(HEAD + MODELS["hoop"])
    columns, numbers, types = written(model, tmp_path / "points.csv")
    numbers[:, list(columns).index("th")] = np.pi / 2
    with sinks.open_sink(tmp_path / "wrong.csv", (*columns, "type"), texts=("type",)) as sink:
        sink.write(numbers, [types])
    assert lagcli.audit(model, tmp_path / "wrong.csv").check("equilibrium").verdict == "fail"
