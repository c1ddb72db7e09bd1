"""Huge and tiny finite numbers: drawn in parts of theirs or refused with the reason, without a word of a library."""

import json
import re
import warnings

import numpy as np
import pytest

from lagcli.model.model import Units
from lagcli.output.figures import chart, figure_page, panels
from lagcli.output.figures.chart import ChartCurve, ChartPanel
from tests.helpers import in_process

W = "forces: {w: {to: all, force: [0, 0, -9.81*m]}}\n"
MODELS = {
    "far": "particles: {a: {mass: 1, position: [1e200, 0, 0]}, b: {mass: 1, position: [-1e200, 0, 1]}}\n"
    "holonomic: {p: a.z = 0}\n",
    "heavy": f"particles: {{a: {{mass: 1e300, position: [1, 0, 0]}}}}\n{W}holonomic: {{r: norm(a) = 1}}\n",
    "light": f"particles: {{a: {{mass: 5e-324, position: [1, 0, 0]}}, b: {{mass: 1, position: [2, 0, 0]}}}}\n{W}"
    "holonomic: {r: norm(a) = 1, s: 'distance(a, b) = 1'}\n",
    "strong": "particles: {a: {mass: 1, position: [1, 0, 0]}}\nforces: {w: {to: all, force: [0, 0, 1e300]}}\n",
    "weak": "particles: {a: {mass: 1, position: [1, 0, 0]}}\nforces: {w: {to: all, force: [0, 0, 5e-324]}}\n",
    "near": "particles: {a: {mass: 1, position: [5e-324, 0, 0]}}\nforces: {s: {potential: 'dot(a, a)/2'}}\n"
    "inequality: {f: 'a.x >= 5e-324'}\n",
    "steep": f"particles: {{a: {{mass: 1, position: [0, 0, 0]}}}}\n{W}inequality: {{f: '1e300*a.z >= 0'}}\n",
    "flat": f"particles: {{a: {{mass: 1, position: [0, 0, 0]}}}}\n{W}inequality: {{f: '5e-324*a.z >= 0'}}\n",
    "turning": "coordinates: {u: {value: 0.3}}\nlagrangian: 1e308*(rate(u)**2/2 + cos(u))\n",
    "long": f"particles: {{a: {{mass: 1, position: [1, 0, 0]}}}}\n{W}holonomic: {{r: '1.7e308*(a.z-a.x+1) = 0'}}\n",
    "edge": "particles: {a: {mass: 1, position: [0, 5e-324, 0], velocity: [0, 1, 0]}}\n"
    "differential: {k: 'a.y*d(a.x) - d(a.z) = 0'}\n",
}
COMMANDS = ("check", "displacements", "simulate", "modes", "equilibrium", "plot", "animate", "report")


def run(*arguments):
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        out, err, code = in_process.run(*arguments)
    assert code != 70, err
    assert [str(one.message) for one in told] == []
    assert not re.search(r"Warning|Traceback|compliant|LinAlg|did not converge", err)
    return out, err, code


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("name", MODELS)
def test_no_command_ends_as_a_bug_of_its_own(name, command, tmp_path, capfd):
    path = tmp_path / f"{name}.yaml"
    path.write_text(f"lagcli: 1\n{MODELS[name]}simulation: {{duration: 1, samples: 3}}\n", encoding="utf-8")
    endings = {"simulate": "csv", "plot": "svg", "animate": "html", "report": "html"}
    more = ["-o", tmp_path / f"out.{endings[command]}"] if command in endings else ["--json"]
    out, _, _ = run(command, path, *more)
    if "--json" in more and out.strip():
        json.loads(out, parse_constant=pytest.fail)
    assert capfd.readouterr() == ("", "")  # what LAPACK prints itself


def test_what_is_refused_says_why(tmp_path):
    path = tmp_path / "far.yaml"
    path.write_text("lagcli: 1\n" + MODELS["far"] + "simulation: {duration: 1}\n", encoding="utf-8")
    _, err, code = run("animate", path, "-o", tmp_path / "a.html")
    assert code == 2
    assert "positions of up to 1e+200 are too large to be drawn" in err
    _, err, code = run("report", path, "-o", tmp_path / "r.html")
    assert code in (0, 1)
    path.write_text("lagcli: 1\n" + MODELS["heavy"] + "simulation: {duration: 1}\n", encoding="utf-8")
    _, err, code = run("equilibrium", path)
    assert code == 1
    assert "forces of the size 9.81e+300: their squares are no numbers" in err


TABLES = {
    "constant": ("t,x", [["0", "1e308"], ["1", "1e308"], ["2", "1e308"]]),
    "both": ("t,x", [["0", "1.7e308"], ["1", "-1.7e308"], ["2", "5e-324"]]),
    "one": ("t,x", [["0", "-1e308"]]),
    "late": ("t,x", [["1e308", "0"], ["1.1e308", "1"]]),
    "soon": ("t,x", [["0", "0"], ["5e-324", "1"]]),
    "force": ("t,lambda.r,R.a.x,R.a.y,R.a.z", [["0", "1e308", "1e200", "1e200", "1"]] * 2),
    "motion": ("t,a.x,a.y,a.z,a.vx", [["0", "0", "1e200", "0", "0"], ["1", "1", "-1e200", "1", "0"]]),
    "dot": ("t,a.x,a.y,a.z,a.vx", [["0", "1e-320", "0", "0", "0"], ["1", "0", "0", "0", "0"]]),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables_are_drawn_or_refused(name, tmp_path):
    head, rows = TABLES[name]
    path = tmp_path / f"{name}.csv"
    path.write_text("\n".join([head, *(",".join(row) for row in rows)]) + "\n", encoding="utf-8")
    _, _, code = run("plot", path, "-o", tmp_path / "out.svg")
    assert code == 0
    run("plot", path)
    run("animate", path, "-o", tmp_path / "out.html")


def test_an_axis_of_values_that_are_too_large_says_its_part():
    t, y = np.array([0.0, 1.0]), np.array([1e308, 1.5e308])
    panel = ChartPanel("time", "t", "x", (ChartCurve("x", t, y, 0, 0),)).drawable()
    assert panel.y_label == "x × 1e-10"
    np.testing.assert_allclose(panel.curves[0].y, [1e298, 1.5e298], rtol=1e-15)
    np.testing.assert_array_equal(panel.curves[0].x, t)
    scale = figure_page.value_scale([panel.curves[0].y], 0.0, 5)
    assert scale.limits[0] < 1e298 < 1.5e298 < scale.limits[1]
    assert len(scale.values) > 2
    # Of a constant too the value stands within the axis.
    scale = figure_page.value_scale([np.full(3, 1e298)], 0.0, 5)
    assert scale.limits[0] < 1e298 < scale.limits[1]
    np.testing.assert_allclose(chart.sizes(np.array([[3e200, 0, 4e200]])), [5e200], rtol=1e-15)
    rows = np.array([[0.0, 1e308], [1.0, -1e308]])
    band = panels.bands(["t", "lambda.r"], rows, Units("m", "kg", "s"))[0]
    assert band.panels[0].y_label.endswith("× 1e-10")
    np.testing.assert_allclose(band.panels[0].curves[0].y, [1e298, -1e298], rtol=1e-15)


def test_the_null_vector_of_a_tiny_twin_is_one(tmp_path):
    """1 / 1e-310 is no number."""
    path = tmp_path / "twin.yaml"
    path.write_text(
        "lagcli: 1\nparticles: {a: {mass: 1, position: [1, 0, 0]}}\n"
        "holonomic: {one: a.z = 0, twin: 1e-310*a.z = 0}\n",
        encoding="utf-8",
    )
    out, _, code = run("check", path)
    assert code == 0
    assert "left out as redundant: 1 row: twin" in out


@pytest.mark.parametrize("huge", ["1e300", "1.7e308"])
def test_times_whose_squares_are_no_doubles_are_no_bug(huge, tmp_path):
    model, table = tmp_path / "model.yaml", tmp_path / "run.csv"
    model.write_text("lagcli: 1\ncoordinates: {x: {value: 1, rate: 1}}\nlagrangian: rate(x)**2/2\n")
    assert in_process.run("simulate", model, "-o", table, "--duration", "1", "--samples", "5", "-q")[2] == 0
    *lines, last = table.read_text().splitlines()
    table.write_text("\n".join([*lines, ",".join([huge, *last.split(",")[1:]])]) + "\n")
    assert in_process.run("audit", model, "--run", table)[2] in (0, 1)
    model.write_text(f"{model.read_text()}simulation: {{duration: {huge}, samples: 5}}\n")
    assert in_process.run("derive", model)[2] == 0
