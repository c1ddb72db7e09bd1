"""`lagcli stationary` and `lagcli equilibrium` from outside: tables, JSON, refusals, and runs from a point."""

import json
from typing import NamedTuple

import numpy as np
import pytest

import lagcli
from tests.helpers import in_process

PENDULUM = """lagcli: 1
parameters: {L: 2}
particles:
  a: {mass: 1, position: [1.2, 0, -1.6]}
forces:
  weight: {to: all, force: [0, 0, -9.81*m]}
holonomic:
  rod: norm(a) = L
simulation: {duration: 1, samples: 11}
"""


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text(PENDULUM)
    return str(path)


class Done(NamedTuple):
    out: str
    err: str
    code: int


def run(*arguments):
    return Done(*in_process.run(*arguments))


def test_the_object_of_json(model):
    done = run("equilibrium", model, "--json")
    assert done.code == 0
    found = json.loads(done.out)
    assert list(found) == ["points", "starts", "complete", "notes"]
    lowest = found["points"][0]
    assert lowest["multipliers"] == {"rod": pytest.approx(-9.81)}
    assert lowest["reactions"]["R.a.z"] == pytest.approx(9.81)
    assert lowest["potential"] == pytest.approx(-19.62)
    assert (lowest["type"], lowest["index"], lowest["unique_multipliers"]) == ("minimum", 0, True)
    assert found["complete"]


def test_a_table_for_people(model):
    done = run("stationary", model, "--of", "a.x + a.y")
    assert done.code == 0
    assert "minimum" in done.out
    assert "maximum" in done.out
    assert "it is proved that there are no others" in done.out


@pytest.mark.parametrize("ending", ["csv", "tsv", "json", "npz", "parquet"])
def test_a_run_starts_at_a_point_of_any_table(model, tmp_path, ending):
    table = tmp_path / f"points.{ending}"
    assert run("equilibrium", model, "-o", str(table), "-q").code == 0
    begun = lagcli.simulate(model, begin=f"{table}:0")
    np.testing.assert_allclose(begun["a.z"], -2, atol=1e-14)
    np.testing.assert_allclose(begun["lambda.rod"], -9.81, rtol=1e-13)
    assert lagcli.simulate(model, begin=table)["a.z"][0] == pytest.approx(2)  # the last row


def test_from_on_the_command_line(model, tmp_path):
    table = str(tmp_path / "points.csv")
    run("equilibrium", model, "-o", table, "-q")
    done = run("simulate", model, "--from", f"{table}:0", "--columns", "t,a.z", "--samples", "2", "-q")
    assert done.code == 0
    assert done.out.splitlines()[1:] == ["0.0,-2.0", "1.0,-2.0"]


def test_a_value_that_is_set_lies_on_top_of_the_row(model, tmp_path):
    table = str(tmp_path / "points.csv")
    run("equilibrium", model, "-o", table, "-q")
    done = run(
        "simulate",
        model,
        "--from",
        f"{table}:0",
        "--set",
        "a.vx=0.3",
        "--columns",
        "a.z,a.vx",
        "--samples",
        "2",
    )
    assert done.code == 0
    assert done.out.splitlines()[1] == "-2.0,0.3"


def test_a_row_of_a_run_carries_its_velocities(model, tmp_path):
    table = str(tmp_path / "run.csv")
    run("simulate", model, "-o", table, "-q")
    whole = lagcli.simulate(model)
    later = lagcli.simulate(model, begin=f"{table}:5", duration=0.5, samples=2)
    assert later.t[0] == 0.0
    assert later["a.x"][1] == pytest.approx(whole["a.x"][10], abs=1e-9)


@pytest.mark.parametrize(
    ("row", "said"),
    [(":2", "it has 2 rows, from 0 to 1"), (":-3", "it has 2 rows")],
)
def test_a_row_that_is_not_there(model, tmp_path, row, said):
    table = str(tmp_path / "points.csv")
    run("equilibrium", model, "-o", table, "-q")
    done = run("simulate", model, "--from", table + row)
    assert done.code == 2
    assert said in done.err


def test_a_table_without_the_columns(model, tmp_path):
    table = tmp_path / "points.csv"
    table.write_text("a.x,a.y\n1,2\n")
    done = run("simulate", model, "--from", str(table))
    assert done.code == 2
    assert "it has no column `a.z`" in done.err


def test_a_table_that_is_not_there(model):
    done = run("simulate", model, "--from", "nothing.csv")
    assert (done.code, "there is no file nothing.csv" in done.err) == (2, True)


def test_an_unknown_name_is_located(model):
    done = run("stationary", model, "--of", "a.x + bob.y")
    assert done.code == 2
    assert "--of:1:7: error[unknown-name]" in done.err
    assert "^^^" in done.err


@pytest.mark.parametrize(
    ("of", "code"), [("a.vx", "velocity-not-allowed"), ("t*a.x", "time-not-allowed"), ("a", "not-a-scalar")]
)
def test_a_function_is_of_positions(model, of, code):
    done = run("stationary", model, "--of", of)
    assert done.code == 2
    assert f"error[{code}]" in done.err


def test_a_constant_is_refused(model):
    done = run("stationary", model, "--of", "2*L")
    assert done.code == 2
    assert "it is a constant" in done.err


def test_modes_of_what_has_no_freedom_are_a_sentence(tmp_path):
    path = tmp_path / "fixed.yaml"
    path.write_text(PENDULUM.replace("norm(a) = L\n", "norm(a) = L\n  x: a.x = 1.2\n  y: a.y = 0\n"))
    done = run("modes", str(path))
    assert (done.code, done.out.splitlines()) == (
        0,
        [
            "stable: no freedom is left: nothing can swing, and there are no modes",
            "linearized at a.x = 1.2, a.y = 0, a.z = -1.6",
        ],
    )
    assert json.loads(run("modes", str(path), "--json").out)["frequencies"] == []


def test_no_point_is_exit_4(tmp_path):
    path = tmp_path / "fall.yaml"
    path.write_text(PENDULUM.replace("holonomic:\n  rod: norm(a) = L\n", ""))
    done = run("equilibrium", str(path))
    assert done.code == 4
    assert "no point of rest was found from 1 start; it is proved that there is none" in done.err
    assert done.out == ""


def test_rows_that_contradict_are_located(tmp_path):
    path = tmp_path / "two.yaml"
    path.write_text(PENDULUM.replace("  rod: norm(a) = L\n", "  rod: norm(a) = L\n  other: norm(a) = 3*L\n"))
    done = run("equilibrium", str(path), "--json")
    assert done.code == 1
    assert json.loads(done.out)["errors"][0]["code"] == "contradictory-constraints"


def test_families_and_definitions_are_known(tmp_path):
    path = tmp_path / "family.yaml"
    path.write_text(
        "lagcli: 1\nparameters: {n: 2}\nparticles:\n"
        '  p[i]: {for: "i = 1..n", mass: 1, position: "[i, 0.1, 0]"}\n'
        "definitions:\n  span: dot(p[1] - p[2], p[1] - p[2])\n"
        "holonomic:\n  one: norm(p[1]) = 1\n  two: norm(p[2]) = 2\n"
    )
    found = json.loads(run("stationary", str(path), "--of", "span + p[2].x*0", "--json", "--starts", "4").out)
    assert sorted({round(p["value"], 9) for p in found["points"]}) == [1.0, 9.0]
