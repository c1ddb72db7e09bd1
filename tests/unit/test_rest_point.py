"""The point of rest that a start leads to: lambda, contacts, integrals, inertial terms, and where there is none."""

import numpy as np
import pytest

import lagcli
from lagcli.api import cache, static_points
from lagcli.statics.rest_equations import EquilibriumPoint

HEAD = "lagcli: 1\n"
WEIGHT = "forces:\n  weight: {to: all, force: [0, 0, -9.81*m]}\n"


def nearest(text: str) -> EquilibriumPoint:
    found = static_points.RestPoints(cache.compiled(lagcli.loads(HEAD + text))).nearest()
    assert found.rests, found
    return found


def none(text: str) -> EquilibriumPoint:
    found = static_points.RestPoints(cache.compiled(lagcli.loads(HEAD + text))).nearest()
    assert not found.rests, found
    return found


def test_a_pendulum_hangs() -> None:
    text = "particles:\n  a: {mass: 2, position: [0.6, 0, -0.8]}\nholonomic:\n  rod: norm(a) = 1\n" + WEIGHT
    found = nearest(text)
    np.testing.assert_allclose(found.q, [0, 0, -1], atol=1e-14)
    np.testing.assert_allclose(found.lam, [-2 * 9.81], rtol=1e-14)
    assert found.residual < 1e-13


def test_of_two_points_the_nearer_is_taken() -> None:
    # Newton's steps lead from these angles to the upright pendulum, which is farther.
    text = (
        "coordinates:\n  th: {{value: {}}}\n"
        "particles:\n  a: {{mass: 1.5, position: ['0.6*sin(th)', 0, '-0.6*cos(th)']}}\n"
    )
    for angle in (1.4, -1.4):
        np.testing.assert_allclose(nearest(text.format(angle) + WEIGHT).q, [0], atol=1e-13)
    np.testing.assert_allclose(nearest(text.format(2.0) + WEIGHT).q, [np.pi], rtol=1e-13)


def test_a_start_off_the_surface_is_led_onto_it() -> None:
    text = "particles:\n  a: {mass: 1, position: [0.1, 0.2, -3]}\nholonomic:\n  rod: norm(a) = 2\n" + WEIGHT
    np.testing.assert_allclose(nearest(text).q, [0, 0, -2], atol=1e-13)


def test_twin_rods_share_the_force_evenly() -> None:
    rods = "holonomic:\n  one: norm(a) = 1\n  two: norm(a) = 1\n"
    found = nearest("particles:\n  a: {mass: 1, position: [0, 0, -1]}\n" + rods + WEIGHT)
    np.testing.assert_allclose(found.lam, [-9.81 / 2] * 2, rtol=1e-12)


def test_a_follower_force_has_no_potential_and_a_point_of_rest() -> None:
    # Torques: m g sin(th) against a force across the rod, F: sin th = F / (m g).
    text = (
        "coordinates:\n  th: {value: 0.1}\nparticles:\n"
        "  a: {mass: 1, position: [sin(th), 0, -cos(th)]}\n" + WEIGHT + "  across: {to: th, force: 4.905}\n"
    )
    assert nearest(text).q[0] == pytest.approx(np.pi / 6, abs=1e-14)


def test_drag_does_nothing_at_rest() -> None:
    text = "particles:\n  a: {mass: 1, position: [0.6, 0, -0.8]}\nholonomic:\n  rod: norm(a) = 1\n" + WEIGHT
    found = nearest(text + "  drag: {to: a, force: -norm(v)*v}\n")
    np.testing.assert_allclose(found.q, [0, 0, -1], atol=1e-14)


HOOP = """parameters: {W: 6, R: 0.5}
coordinates:
  th: {value: 0.9}
particles:
  bead: {mass: 1, position: "[R*sin(th)*cos(W*t), R*sin(th)*sin(W*t), -R*cos(th)]"}
"""


def test_a_bead_rests_on_a_turning_hoop() -> None:
    """Places that hold t, though the equations at rest do not depend on it: cos th = g / (W^2 R)."""
    assert nearest(HOOP + WEIGHT).q[0] == pytest.approx(np.arccos(9.81 / 18), abs=1e-13)


def test_what_swings_with_time_does_not_rest() -> None:
    text = "coordinates:\n  x: {value: 1}\nlagrangian: rate(x)**2/2 - (x - sin(t))**2\n"
    assert none(text).residual > 0.1


def test_a_stiffness_that_grows_leaves_its_point_of_rest() -> None:
    text = "coordinates:\n  x: {value: 1}\nlagrangian: rate(x)**2/2 - (1 + t**2)*(x - 2)**2\n"
    assert nearest(text).q[0] == pytest.approx(2, abs=1e-14)


def test_on_a_moving_ramp_nothing_rests() -> None:
    text = "particles:\n  a: {mass: 1, position: [0, 0, 0]}\nholonomic:\n  ramp: a.z = a.x - t\n" + WEIGHT
    none(text)


def test_a_ball_lies_on_the_floor_and_its_multiplier_pushes() -> None:
    text = "particles:\n  a: {mass: 2, position: [0, 0, 3]}\ninequality:\n  floor: a.z >= 1\n" + WEIGHT
    found = nearest(text)
    assert found.q[2] == pytest.approx(1, abs=1e-14)
    assert found.closed == (0,)
    assert found.lam[0] == pytest.approx(19.62, rel=1e-14)


def test_a_ball_in_a_corner_touches_both_sides() -> None:
    sides = "inequality:\n  left: a.z >= a.x\n  right: a.z >= -2*a.x\n"
    found = nearest("particles:\n  a: {mass: 1, position: [0.5, 0, 3]}\n" + sides + WEIGHT)
    np.testing.assert_allclose(found.q, [0, 0, 0], atol=1e-13)
    np.testing.assert_allclose(found.lam, [9.81 * 2 / 3, 9.81 / 3], rtol=1e-12)


def test_a_ceiling_that_would_have_to_pull_is_open() -> None:
    text = (
        "particles:\n  a: {mass: 1, position: [0, 0, -1.9]}\nholonomic:\n  rod: norm(a) = 2\n"
        "inequality:\n  ceiling: a.z <= 1\n" + WEIGHT
    )
    found = nearest(text)
    assert found.closed == ()
    np.testing.assert_allclose(found.lam, [-9.81, 0], rtol=1e-13)


def test_an_integrable_row_holds_the_leaf_of_the_start() -> None:
    text = (
        "coordinates:\n  x: {value: 1}\n  th: {value: 0.25}\n"
        "lagrangian: rate(x)**2 + rate(th)**2 - x**2/2 - 2*th**2\n"
        "differential:\n  roll: d(x) - 2*d(th) = 0\n"
    )
    found = nearest(text)  # x = 2 th + 1/2; x + lam = 0 and 4 th - 2 lam = 0
    np.testing.assert_allclose(found.q, [1 / 4, -1 / 8], atol=1e-13)
    np.testing.assert_allclose(found.lam, [1 / 4], atol=1e-13)


def test_a_free_fall_has_no_point_of_rest() -> None:
    assert none("particles:\n  a: {mass: 1, position: [0, 0, 3]}\n" + WEIGHT).residual == pytest.approx(9.81)


def test_a_force_that_fades_far_away_makes_no_point_there() -> None:
    none("coordinates:\n  x: {value: 1}\nlagrangian: rate(x)**2/2 - 1/x\n")


def test_modes_about_the_nearest_point_of_rest_look_for_a_consistent_start_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    starts: list[object] = []
    begin = static_points.begin
    monkeypatch.setattr(static_points, "begin", lambda *given: starts.append(given) or begin(*given))
    text = "particles:\n  a: {mass: 1, position: [0.6, 0, -0.8]}\nholonomic:\n  rod: norm(a) = 1\n" + WEIGHT
    assert lagcli.modes(lagcli.loads(HEAD + text)).notes
    assert len(starts) == 1
