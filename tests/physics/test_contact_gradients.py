"""Conditions whose gradient vanishes or jumps where they close: handled where there is one direction, else told."""

import numpy as np
import pytest

import lagcli

pytestmark = pytest.mark.numeric

START = """lagcli: 1
particles:
  a: {{mass: 1, position: {}, velocity: {}}}
inequality:
  wall: {{condition: "{}", restitution: {}}}
"""
WEIGHT = "forces: {weight: {to: a, force: [0, 0, -1]}}\n"
CORNER = "max(abs(a.x), abs(a.y)) <= 1"


def run(condition, position, velocity, e=1, duration=4.0, weight=False):
    text = START.format(position, velocity, condition, e) + (WEIGHT if weight else "")
    return lagcli.simulate(lagcli.loads(text), duration=duration, samples=41)


def reason(*where, **how):
    with pytest.raises(lagcli.SimulationStopped) as stopped:
        run(*where, **how)
    assert "`wall`" in str(stopped.value)
    return stopped.value


@pytest.mark.parametrize(
    "condition", ["a.z**3 >= 0", "a.z*abs(a.z) >= 0", "a.z - sin(a.z) >= 0", "a.z**5 >= 0"]
)
@pytest.mark.parametrize("e", [0, 0.5, 1])
def test_a_gradient_that_vanishes_where_the_contact_closes_is_reported(condition, e):
    stop = reason(condition, [0, 0, 1], [0.3, 0, 0], e, weight=True)
    assert "the gradient vanishes where the contact closes" in str(stop)
    assert stop.t == pytest.approx(2**0.5, abs=1e-2)


def test_a_gradient_that_vanishes_at_the_start_is_reported():
    assert "vanishes" in reason("a.z**3 >= 0", [0, 0, 0], [0, 0, -1]).args[0]


def test_a_small_sphere_by_its_square_has_a_gradient():
    # The gradient falls to 2e-5 of what it was, and is one all the same.
    found = run("a.x**2 + a.y**2 + a.z**2 >= 1e-10", [1, 0, 0], [-1, 0, 0], duration=2.0)
    assert found.events["t"][0] == pytest.approx(1 - 1e-5, abs=1e-9)
    assert found["a.vx"][-1] == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("e", [0, 0.5, 1])
@pytest.mark.parametrize("way", [[1, 1, 0], [2, 1, 0]])
def test_a_corner_of_one_condition_that_is_hit_exactly_is_decided_by_its_walls(way, e):
    start = [1 - way[0] / 2, 1 - way[1] / 2, 0]
    found = run(CORNER, start, way, e, duration=0.8)
    assert [found[f"a.v{axis}"][-1] for axis in "xy"] == pytest.approx([-e * v for v in way[:2]], abs=1e-12)
    incidents = list(zip(found.events["kind"], found.events["name"], strict=True))
    assert incidents == [("impact", "wall[2]"), ("impact", "wall[4]")]
    assert list(found.events["t"]) == pytest.approx([0.5, 0.5], abs=1e-12)


def test_a_wall_is_no_corner_however_near():
    found = run(CORNER, [0, 0, 0], [1, 0.999999, 0], duration=1.5)
    assert found.stats.impacts == 2
    assert [found[f"a.v{axis}"][-1] for axis in "xy"] == pytest.approx([-1, -0.999999], abs=1e-12)


def test_each_side_as_a_condition_of_its_own_decides_the_corner():
    sides = "  wall: {condition: abs(a.x) <= 1, restitution: 1}\n  other: {condition: abs(a.y) <= 1, restitution: 1}\n"
    text = START.format([0, 0.5, 0], [2, 1, 0], "", 1).split("  wall")[0] + sides
    found = lagcli.simulate(lagcli.loads(text), duration=1.0, samples=11)
    assert [found[f"a.v{axis}"][-1] for axis in "xy"] == pytest.approx([-2, -1], abs=1e-12)
    assert list(found.events["t"]) == [0.5, 0.5]


def test_a_stadium_is_hit_where_its_curvature_jumps():
    stadium = "norm([max(abs(a.x) - 1, 0), a.y, 0]) <= 1"
    found = run(stadium, [0, 0, 0], [1, 1, 0], duration=4.0)
    assert list(found.events["t"]) == pytest.approx([1, 2, 3], abs=1e-12)
    assert [found[f"a.v{axis}"][-1] for axis in "xy"] == pytest.approx([-1, 1], abs=1e-12)
    assert np.abs(found["energy"] / found["energy"][0] - 1).max() < 1e-14
