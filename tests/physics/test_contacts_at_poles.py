"""A closed contact whose multiplier has a pole where rows become dependent: it opens there, and not later.

A disc that rolls upright stands with its rim against a wall, held in place by a force along the wall, and turns about
the vertical. At psi = -pi/2 it is parallel to the wall: until then lambda of the wall is F_y tan psi + F_x, which grows
beyond all bounds, and behind that it would have to pull.
"""

import numpy as np
import pytest

import lagcli

pytestmark = pytest.mark.numeric

ROLLING = """lagcli: 1
parameters: {R: 0.5, k: 0.2, J: 0.3, w0: -0.5, x0: 0.8, y0: -0.1}
lagrangian: "(rate(x)**2 + rate(y)**2)/2 + 0.1*rate(psi)**2 + J/2*rate(phi)**2 - k*x*y"
coordinates:
  x: {value: x0}
  y: {value: y0}
  psi: {value: START, rate: w0}
  phi: {}
forces: {steer: {to: psi, force: -0.1}}
differential:
  forward: rate(x) = R*rate(phi)*cos(psi)
  sideways: rate(y) = R*rate(phi)*sin(psi)
"""
WALL = 'inequality: {wall: {condition: "x <= x0", restitution: E}}\n'

TOUCHED = """lagcli: 1
particles:
  lifted: {mass: 1, position: [0, 0, 0.1], velocity: [0, 0, -1]}
  pressed: {mass: 1, position: [1, 0, 0]}
forces:
  up: {to: lifted, force: [0, 0, 4 - 12*t]}
  down: {to: pressed, force: [0, 0, 30*t - 12]}
inequality:
  floor: lifted.z >= 0
  table: pressed.z >= 0
"""


@pytest.mark.parametrize("e", [0, 0.7])
def test_a_contact_whose_multiplier_has_a_pole_opens_there(e):
    text = ROLLING.replace("START", "-1") + WALL.replace("E", str(e))
    run = lagcli.simulate(lagcli.loads(text), duration=2, samples=101)
    # psi'' = -1/2, so that it goes through -pi/2 along a parabola.
    pole = np.sqrt(1 + 4 * (np.pi / 2 - 1)) - 1
    events = run.events
    assert list(events["kind"]) == ["crossing", "crossing", "release"]
    assert events["name"][-1] == "wall"
    assert events["t"] == pytest.approx([pole] * 3, abs=1e-9)
    held = run.t < pole
    assert (run["lambda.wall"][~held] == 0).all()
    psi, force = run["psi"][held], np.array([0.2 * 0.1, -0.2 * 0.8])
    assert run["lambda.wall"][held] == pytest.approx(force[0] + force[1] * np.tan(psi), rel=1e-8)
    assert run["lambda.forward"][held] == pytest.approx(force[1] * np.tan(psi), rel=1e-8)
    # From there on it rolls as one that has no wall, and away from it.
    model = lagcli.loads(ROLLING.replace("START", "-pi/2"), parameters={"w0": -0.5 - 0.5 * pole})
    free = lagcli.simulate(model, duration=2 - pole, samples=2)
    for name in ("x", "y", "phi", "lambda.forward", "R.x", "R.y"):
        assert run[name][-1] == pytest.approx(free[name][-1], abs=1e-9)
    assert run["x"][-1] < 0.8 - 1e-4
    assert lagcli.audit(lagcli.loads(text)).passed


def test_a_contact_that_touched_once_is_not_closed_from_afar_where_another_opens():
    run = lagcli.simulate(lagcli.loads(TOUCHED), duration=0.6, samples=61)
    assert list(zip(run.events["kind"], run.events["name"], strict=True)) == [
        ("impact", "floor"),
        ("release", "table"),
    ]
    way = np.polynomial.Polynomial([0, 0, 2, -2])
    falling = np.polynomial.Polynomial([0.1, -1]) + way
    hit = min(root.real for root in falling.roots() if 0 < root.real < 1)
    assert run.events["t"] == pytest.approx([hit, 0.4], abs=1e-10)
    away = run.t > hit
    z = way(run.t) - way(hit) - way.deriv()(hit) * (run.t - hit)
    assert run["lifted.z"][away] == pytest.approx(z[away], abs=1e-10)
    assert (run["lambda.floor"] == 0).all()
    assert lagcli.audit(lagcli.loads(TOUCHED)).passed
