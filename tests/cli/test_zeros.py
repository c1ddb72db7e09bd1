"""What is zero to rounding reads and draws as zero; figures label what is known of the unit of a multiplier."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.api import prepare_run, run_settings
from lagcli.model import dimension_facts
from lagcli.output.figures import panels
from lagcli.running import table_columns
from tests.helpers import in_process

command = in_process.command

BALL = """\
lagcli: 1
parameters: {m: 1, a: 0.1, I: 2/5*m*a**2}
coordinates:
  x: {}
  y: {}
  theta: {value: 1, rate: 0.5}
  phi: {rate: 2}
  psi: {rate: 1}
definitions:
  wx: rate(theta)*cos(phi) + rate(psi)*sin(theta)*sin(phi)
  wy: rate(theta)*sin(phi) - rate(psi)*sin(theta)*cos(phi)
  wz: rate(phi) + rate(psi)*cos(theta)
lagrangian: m/2*(rate(x)**2 + rate(y)**2) + I/2*(wx**2 + wy**2 + wz**2)
differential:
  roll_x: rate(x) = a*wy
  roll_y: rate(y) = -a*wx
simulation: {duration: 2, samples: 51, assemble: true}
"""


def running(text, **options):
    model = lagcli.loads(text)
    return prepare_run.prepare(model, run_settings.chosen(model, {}), **options)


def zero_columns(text):
    ready = running(text)
    floors = ready.floors()
    for block in ready.blocks():
        floors.take(block)
    return {name for name, flag in zip(ready.columns, floors.zeros(), strict=True) if flag}


def test_a_ball_that_rolls_freely_has_no_multipliers_to_rounding():
    run = lagcli.simulate(lagcli.loads(BALL), digits=True)
    assert np.abs(run["lambda.roll_x"]).max() > 0  # the table keeps its numbers
    digits = run.stats.accuracy
    assert digits.digits["lambda"] is None
    assert digits.digits["R"] is None
    assert digits.digits["r"] > 9
    assert digits.sentence.endswith(", multipliers and R are zero to rounding")
    assert {"lambda.roll_x", "lambda.roll_y", "R.x", "R.y"} <= zero_columns(BALL)


REACH = """\
lagcli: 1
particles:
  a: {mass: 1, position: [0.5, 0, 0.8660254037844386]}
  b: {mass: 2, position: [1, 0, 0]}
  c: {mass: 1, position: [0.6, 0, -0.8]}
forces: {w: {to: all, force: [0, 0, -9.81*m]}}
holonomic:
  r1: norm(a) = 1
  r2: distance(a, b) = 1
  p1: a.y = 0
  p2: b.y = 0
  p3: b.z = 0
  led: b.x = 1 + t
  rc: norm(c) = 1
  pc: c.y = 0
simulation: {duration: 0.9999999999, samples: 201, assemble: true}
"""


def test_a_force_that_is_huge_at_the_last_row_makes_no_other_rounding():
    """Two rods are led to their reach, where they pull with 1e19 N; the pendulum beside them pulls with 10 N."""
    zeros = zero_columns(REACH)
    assert "R.a.x" in zeros  # a.x is half of b.x, without acceleration
    assert not {"lambda.rc", "R.c.x", "R.c.z", "R.b.z", "lambda.r1"} & zeros


SCALES = """\
lagcli: 1
parameters: {{k: {k}}}
particles:
  a: {{mass: 1, position: [1, 0, 0]}}
  b: {{mass: 1e-6, position: [3, 0, 0]}}
forces: {{weight: {{to: all, force: [0, 0, -9.81*m]}}, side: {{to: b, force: [0, k, 0]}}}}
holonomic: {{floor_a: a.z = 0, floor_b: b.z = 0, wall_b: b.y = 0}}
simulation: {{duration: 1, samples: 5}}
"""


@pytest.mark.parametrize("force", [1e-3, 1e-8, 1e-11])
def test_small_forces_are_no_rounding(force):
    assert not zero_columns(SCALES.format(k=force)) & {"lambda.wall_b", "lambda.floor_b", "R.b.y", "R.b.z"}


def test_a_rod_at_rest_has_velocities_that_are_zero_to_rounding():
    text = """\
lagcli: 1
parameters: {s: sqrt(2)/2}
particles: {a: {mass: 1, position: [s, s, -1]}}
forces: {weight: {to: all, force: [-m*s, -m*s, m]}}
holonomic: {rod: norm(a) = sqrt(2)}
simulation: {duration: 2, samples: 21}
"""
    run = lagcli.simulate(lagcli.loads(text), digits=True)
    assert np.abs(run["a.vx"]).max() < 1e-13
    assert run.stats.accuracy.digits["v"] is None
    assert run.stats.accuracy.digits["lambda"] > 9


def test_the_floor_moves_when_its_constant_does(monkeypatch):
    monkeypatch.setattr(table_columns, "FORCE_ROUNDOFF", 1e-19)
    assert "lambda.roll_x" not in zero_columns(BALL)


def test_the_figure_draws_rounding_as_zero_with_a_note():
    ready = running(BALL)
    table = np.concatenate(list(ready.blocks()))
    plain = panels.bands(ready.columns, table, ready.model.units)
    assert np.abs(plain[0].panels[0].curves[0].y).max() > 0
    found = panels.bands(ready.columns, table, ready.model.units, panels.PanelFacts(zeros=zero_columns(BALL)))
    for panel in found[0].panels:
        assert all(not curve.y.any() for curve in panel.curves)
    assert found[0].note == "zero to rounding: roll_x, roll_y"
    assert found[1].note == "zero to rounding"


@pytest.mark.parametrize(
    ("equation", "power"),
    [
        ("norm(a) = L", 1),
        ("a.z = h*atan2(a.y, a.x)", 1),
        ("a.x**2 + a.y**2 = L**2", 2),
        ("dot(a, b) = 0", 2),
        ("-a.z - b.z = L - u*t", 1),
        ("distance(a, b) - 2*norm(b) = 0", 1),
        ("a.z = 1", 1),
        ("sin(q)*a.x = cos(q)*a.y", 1),
        ("atan2(a.y, a.x) = q", 0),
        ("a.x/a.y = 2", 0),
        ("sqrt(a.x**2 + a.y**2) = L", 1),
        ("L*a.x = h", None),
        ("q = u*t", None),
        ("a.x = a.y**2", None),
        ("2*(a.x - L) = 0", 1),
    ],
)
def test_the_dimension_of_a_row_is_read_off_its_particles(equation, power):
    text = f"""\
lagcli: 1
parameters: {{L: 1, h: 1, u: 1}}
coordinates: {{q: {{value: 1}}}}
lagrangian: rate(q)**2/2
particles:
  a: {{mass: 1, position: [1, 2, 3]}}
  b: {{mass: 1, position: [4, 2, 3]}}
holonomic:
  row: "{equation}"
"""
    assert dimension_facts.of(lagcli.loads(text)).length("row") == power


class Labels:
    length, mass, time = "m", "kg", "s"


@pytest.mark.parametrize(
    ("powers", "label", "titles"),
    [
        ({"f": 1, "g": 1}, "λᵢ (N)", [""]),
        ({"f": 0, "g": 0}, "λᵢ (N·m)", [""]),
        ({"f": 2, "g": 2}, "λᵢ (N/m)", [""]),
        ({}, "λᵢ (N·m / unit of fᵢ)", [""]),
        ({"f": 1, "g": 0}, "λᵢ", ["f (N)", "g (N·m)"]),
        ({"f": 1}, "λᵢ", ["f (N)", "g (N·m / unit of fᵢ)"]),
    ],
)
def test_multipliers_of_lengths_are_newtons(powers, label, titles):
    table = np.array([[0, 1, 2], [1, 1, 2.0]])
    known = dimension_facts.DimensionFacts(powers, frozenset(), frozenset())
    facts = panels.PanelFacts(dimensions=known)
    (band,) = panels.bands(["t", "lambda.f", "lambda.g"], table, Labels(), facts)
    assert " ".join(band.panels[0].y_label.split()) == label
    assert [" ".join(panel.title.split()) for panel in band.panels] == titles


ANGLE = """\
lagcli: 1
parameters: {om: 3, R: 1, k: 2}
coordinates: {th: {value: 0}, 'q[i]': {for: 'i = 1..2', value: 0}, x: {value: 0}, s: {value: 0}}
particles:
  a: {mass: 1, position: '[R*cos(2*th) + x, R*sin(th - om*t), sin(k*s)]'}
  b: {mass: 1, position: '[cos(q[1] + q[2]), 0, s]'}
holonomic:
  motor: th = om*t
  'geared[i]': {for: 'i = 1..2', equation: 'q[i] = 2*th'}
  slide: x = 0.1*t
"""


def test_a_coordinate_under_a_sine_is_an_angle():
    known = dimension_facts.of(lagcli.loads(ANGLE))
    assert known.angles == {"th", "q"}
    assert known.lengths == {"motor": 0, "geared": 0}
    assert known.length("geared[2]") == 0
    columns = ["t", "lambda.motor", "R.th", "R.q[1]"]
    facts = panels.PanelFacts(dimensions=known)
    found = panels.bands(columns, np.ones((2, 4)), Labels(), facts)
    assert [" ".join(band.panels[0].y_label.split()) for band in found] == ["λᵢ (N·m)", "Qʹⱼ (N·m)"]


def test_the_figure_shows_the_columns_that_are_chosen(command, tmp_path, monkeypatch):
    from lagcli.output.figures import chart_figure

    seen = []
    compose = chart_figure.compose_run

    def composing(columns, rows, **more):
        seen.append((columns, rows.shape))
        return compose(columns, rows, **more)

    monkeypatch.setattr(chart_figure, "compose_run", composing)
    path = tmp_path / "m.yaml"
    path.write_text(SCALES.format(k=1), encoding="utf-8")
    for patterns in ("t,lambda.floor_a", "R.b.y,energy", "energy"):
        assert command("simulate", path, "--plot", tmp_path / "x.png", "--columns", patterns)[2] == 0
    assert seen[0] == (("t", "lambda.floor_a"), (5, 2))
    assert seen[1] == (("t", "R.b.x", "R.b.y", "R.b.z"), (5, 4))
    assert len(seen[2][0]) > 10


def test_an_equation_is_explained_by_its_number(command):
    for word in ("D.24", "(D.24)", "d.24"):
        out, _, code = command("explain", word)
        assert code == 0
        assert out.startswith("(D.24) The whole system for r, v and lambda")
        assert max(map(len, out.splitlines())) <= 80
    assert command("explain", "D.54")[1:] == ("lagcli: the equations are D.1 to D.53\n", 2)


def test_the_growth_vector_says_that_time_counts(command, tmp_path):
    path = tmp_path / "m.yaml"
    text = "lagcli: 1\ncoordinates: {x: {}, y: {}, z: {}}\nlagrangian: rate(x)**2 + rate(y)**2 + rate(z)**2\n"
    path.write_text(text + "differential: {w: d(z) - y*d(x) - sin(t)*d(y) = 0}\n", encoding="utf-8")
    assert "of 4 dimensions, time among them," in command("check", path)[0]
    path.write_text(text + "differential: {w: d(z) - y*d(x) = 0}\n", encoding="utf-8")
    assert "growth vector: (2, 3) of 3, bracket-generating" in command("check", path)[0]


@pytest.mark.parametrize("columns", [40, 80])
def test_a_table_too_wide_for_a_terminal_is_reported_row_by_row(columns):
    from lagcli.cli.terminal import console

    headers = ["", *(f"d{i}" for i in range(8)), "allowed"]
    table = [[f"coordinate{k}", *(f"{0.123456 * i:.6g}" for i in range(8)), ""] for k in range(3)]
    lines = list(console.stacked(headers, table, columns))
    assert max(map(len, lines)) <= columns
    assert sum(not line.startswith(" ") for line in lines) == 3
    text = " ".join(line.strip() for line in lines)
    assert all(cell in text for row in table for cell in row)
    assert text.startswith("coordinate0: d0 0; d1 0.123456; ")
    assert "allowed" not in text  # an empty cell says nothing
