"""Points of rest and stationary points against closed forms: all of them, with lambda, R, type and completeness."""

import math

import numpy as np
import pytest

import lagcli

pytestmark = pytest.mark.numeric

HEAD = "lagcli: 1\n"
WEIGHT = "forces:\n  weight: {to: all, force: [0, 0, -9.81*m]}\n"
POINT = "particles:\n  a: {mass: 1, position: [0.3, 0.2, 0.5]}\n"


def rest(text, **options):
    return lagcli.equilibrium(lagcli.loads(HEAD + text), **{"starts": 6, **options})


def stationary(text, of, **options):
    return lagcli.stationary(lagcli.loads(HEAD + text), of, **{"starts": 6, **options})


def kinds(found):
    return [point.type for point in found]


def test_xyz_on_a_sphere_has_fourteen_points():
    found = stationary(POINT + "holonomic:\n  sphere: a.x**2 + a.y**2 + a.z**2 = 1\n", "a.x*a.y*a.z")
    assert found.complete
    assert kinds(found) == ["minimum"] * 4 + ["saddle"] * 6 + ["maximum"] * 4
    largest = 3**-1.5
    np.testing.assert_allclose([p.value for p in found], [-largest] * 4 + [0] * 6 + [largest] * 4, atol=1e-15)
    for point in found:
        # f is homogeneous of degree 3, the row of degree 2: 3 f = 2 lambda.
        assert point.multipliers["sphere"] == pytest.approx(1.5 * point.value, abs=1e-15)
    assert [point.index for point in found] == [0] * 4 + [1] * 6 + [2] * 4


def test_a_function_on_two_surfaces():
    rows = "holonomic:\n  cylinder: a.x**2 + a.y**2 = 1\n  plane: a.x - a.y + a.z = 1\n"
    found = stationary(POINT + rows, "a.x + 2*a.y + 3*a.z")
    assert found.complete
    np.testing.assert_allclose([p.value for p in found], [3 - math.sqrt(29), 3 + math.sqrt(29)], rtol=1e-14)
    np.testing.assert_allclose([p.multipliers["plane"] for p in found], [3, 3], rtol=1e-13)
    assert found[1].reactions["R.a.z"] == pytest.approx(3, rel=1e-13)


def test_where_gradients_depend_on_each_other_the_rule_fails_and_that_is_reported():
    found = stationary(POINT + "holonomic:\n  cusp: a.x**3 = a.y**2\n  plane: a.z = 0\n", "a.x")
    assert len(found) == 0
    assert any("a.x = 0, a.y = 0, a.z = 0 the gradients of the rows depend" in note for note in found.notes)


def test_a_ring_is_one_point_with_its_dimension():
    found = stationary(POINT + "holonomic:\n  ball: norm(a) = 1\n", "a.z**2")
    assert [point.dimension for point in found] == [1, 0, 0]
    assert kinds(found) == ["minimum", "maximum", "maximum"]  # of the equator by the directions across
    assert found[0].at["a.z"] == pytest.approx(0, abs=1e-12)
    assert not found.complete


def test_walls_may_pull_where_a_function_is_stationary():
    rows = "inequality:\n  x: a.x >= 0\n  y: a.y >= 0\n  z: a.z >= 0\nholonomic:\n  s: a.x + a.y + a.z = 1\n"
    found = stationary(POINT + rows, "a.x**2 + 2*a.y**2 + 3*a.z**2")
    assert found.complete
    assert kinds(found) == ["minimum", "saddle", "saddle", "maximum", "saddle", "maximum", "maximum"]
    np.testing.assert_allclose([p.value for p in found], [6 / 11, 2 / 3, 3 / 4, 1, 6 / 5, 2, 3], rtol=1e-13)
    assert found[1].multipliers["z"] == pytest.approx(-4 / 3, rel=1e-13)


def test_a_nonholonomic_row_is_left_out_with_a_note():
    text = (
        "coordinates:\n  x: {value: 0.3}\n  y: {value: 0.4}\n  th: {value: 0.2}\nlagrangian: rate(x)**2\n"
        "differential:\n  knife: sin(th)*rate(x) - cos(th)*rate(y) = 0\n"
    )
    found = stationary(text, "x**2 + y**2 + th**2")
    assert found.complete
    assert kinds(found) == ["minimum"]
    assert found.notes[0] == "`knife` cannot be integrated and is left out"
    assert found[0].multipliers == {}


def test_an_integrable_row_is_its_leaf_through_the_start():
    text = (
        "coordinates:\n  x: {value: 1}\n  th: {value: 0.25}\nlagrangian: rate(x)**2 + rate(th)**2\n"
        "differential:\n  roll: d(x) - 2*d(th) = 0\n"
    )
    found = stationary(text, "x**2 + th**2")  # x = 2 th + 1/2: (2 x, 2 th) = lambda (1, -2)
    assert found.complete
    np.testing.assert_allclose([found[0].at["x"], found[0].at["th"]], [0.1, -0.2], atol=1e-14)
    assert found[0].multipliers["roll"] == pytest.approx(0.2, abs=1e-14)


HOOP = """parameters: {{W: {W}, R: 0.5}}
coordinates:
  th: {{value: 0.3}}
particles:
  bead: {{mass: 0.4, position: "[R*sin(th)*cos(W*t), R*sin(th)*sin(W*t), -R*cos(th)]"}}
"""


@pytest.mark.parametrize(
    ("W", "expected"), [(4.0, ["minimum", "maximum"]), (6.0, ["minimum"] * 2 + ["maximum"] * 2)]
)
def test_a_bead_on_a_turning_hoop_through_its_bifurcation(W, expected):
    found = rest(HOOP.format(W=W) + WEIGHT)
    assert found.complete
    assert kinds(found) == expected
    above = sorted(p.at["th"] for p in found)
    theta = math.acos(9.81 / (W**2 * 0.5)) if W == 6 else 0
    np.testing.assert_allclose(above, sorted({-theta, 0.0, theta, math.pi}), atol=1e-13)
    slow = next(p for p in found if p.at["th"] == pytest.approx(theta))
    centrifugal = 0.4 * 0.5 * math.sin(theta) * W**2
    assert slow.reactions["R.bead.x"] == pytest.approx(-centrifugal, abs=1e-12)
    assert slow.value == pytest.approx(
        -0.4 * 9.81 * 0.5 * math.cos(theta) - 0.4 * (W * 0.5 * math.sin(theta)) ** 2 / 2, rel=1e-13
    )


def test_at_the_bifurcation_the_fourth_derivative_decides():
    found = rest(HOOP.format(W=math.sqrt(9.81 / 0.5)) + WEIGHT)
    lowest = min(found, key=lambda p: p.value)
    assert (lowest.type, lowest.index) == ("minimum", 0)
    assert lowest.dimension == 0
    assert lowest.at["th"] == pytest.approx(0, abs=1e-13)


def test_forces_without_a_potential_leave_no_type():
    text = (
        "coordinates:\n  u: {value: 0.1}\n  w: {value: 0.2}\n"
        "lagrangian: rate(u)**2 + rate(w)**2 - 2*(u - 1)**2 - 3*w**2\n"
        "forces:\n  one: {to: u, force: w}\n  other: {to: w, force: -u}\n"
    )
    found = rest(text)  # -4 (u - 1) + w = 0, -6 w - u = 0
    assert found.complete
    assert (found[0].type, found[0].index, found[0].value) == (None, None, None)
    np.testing.assert_allclose([found[0].at["u"], found[0].at["w"]], [24 / 25, -4 / 25], rtol=1e-14)


def test_a_spring_written_as_a_force_has_its_potential():
    text = "particles:\n  a: {mass: 1, position: [1, 0, 0]}\nforces:\n  spring: {to: a, force: '-4*r + [2, 0, 0]'}\n"
    found = rest(text)
    assert kinds(found) == ["minimum"]
    # Counted from the start: 2 |r|^2 - 2 x less its value there.
    assert found[0].value == pytest.approx((2 * 0.25 - 2 * 0.5) - (2 - 2), rel=1e-12)


def test_a_knife_edge_rests_in_a_family():
    text = (
        "coordinates:\n  x: {value: 0.3}\n  y: {value: 0.4}\n  th: {value: 0.2}\n"
        "lagrangian: (rate(x)**2 + rate(y)**2 + rate(th)**2)/2 - (x**2 + y**2)/2\n"
        "differential:\n  knife: sin(th)*rate(x) - cos(th)*rate(y) = 0\n"
    )
    found = rest(text)
    assert {point.dimension for point in found} == {2}
    at, lam = found[0].at, found[0].multipliers["knife"]
    np.testing.assert_allclose(
        [lam * math.sin(at["th"]), -lam * math.cos(at["th"])], [at["x"], at["y"]], atol=1e-12
    )


def test_one_coordinate_by_intervals():
    found = rest("coordinates:\n  u: {value: 0.1}\nlagrangian: rate(u)**2 - cosh(u) + 2*u**2\n")
    assert found.complete
    assert kinds(found) == ["minimum", "minimum", "maximum"]
    u = found[1].at["u"]
    assert math.sinh(u) == pytest.approx(4 * u, rel=1e-13)


def test_an_inexact_number_is_no_proof():
    text = POINT + "holonomic:\n  sphere: a.x**2 + a.y**2 + a.z**2 = sqrt(2)\n"
    found = stationary(text, "a.x*a.y*a.z", starts=30)
    assert len(found) == 14
    assert not found.complete


def test_a_ball_on_a_plane_floor_rests_anywhere():
    found = rest(POINT + "inequality:\n  floor: a.z >= 0\n" + WEIGHT, starts=3)
    assert [point.dimension for point in found] == [2]
    assert found[0].multipliers["floor"] == pytest.approx(9.81, rel=1e-14)
    assert found[0].at["a.x"] == 0.3


def test_nothing_rests_in_free_fall():
    found = rest(POINT + WEIGHT)
    assert len(found) == 0
    assert found.best_residual == pytest.approx(9.81)


def test_the_answer_is_the_same_twice():
    text = POINT + "holonomic:\n  rod: norm(a) = sqrt(3)\n" + WEIGHT
    assert rest(text).as_json() == rest(text).as_json()


def test_the_work_of_stiff_forces_is_told_or_not_without_a_word_of_a_library() -> None:
    found = lagcli.equilibrium(
        lagcli.loads("""
lagcli: 1
particles:
  s: {mass: 3, position: [0, 0, 0.5]}
  a: {mass: 5, position: [0.9, 0, 0.5]}
forces:
  weight: {to: all, force: "[0, 0, -9.81*m]"}
  on_s: {to: s, force: "-8e5*(distance(s, a/2) - 0.45)*(s - a/2)/distance(s, a/2)"}
  on_a: {to: a, force: "4e5*(distance(s, a/2) - 0.45)*(s - a/2)/distance(s, a/2)"}
holonomic:
  axis1: s.x = 0
  axis2: s.y = 0
  rod: "distance(a, [0, 0, 1]) = sqrt(1.06)"
  plane: a.y = 0
""")
    )
    assert len(found.points) > 1
