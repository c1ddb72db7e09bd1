"""Impacts close to a singular configuration of a linkage: right at a distance, told with the reason where not."""

import numpy as np
import pytest

import lagcli
from tests.helpers.parallelogram import LINKAGE

pytestmark = pytest.mark.numeric

WALLED = f"""{LINKAGE}\
inequality: {{wall: {{condition: "a.y >= PLACE", restitution: E}}}}
simulation: {{samples: 31}}
"""


def run(place, e, duration=6):
    return lagcli.simulate(
        lagcli.loads(WALLED.replace("PLACE", str(place)).replace("E}", f"{e}}}")), duration=duration
    )


@pytest.mark.parametrize("place", [0.01, -0.01, -0.03])
@pytest.mark.parametrize("e", [0.5, 1])
def test_a_rebound_leads_back_through_the_crossing_that_it_came_through(place, e):
    found = run(place, e, duration=2.5)
    hit = np.arccos(place)
    assert found.events["t"][list(found.events["kind"]).index("impact")] == pytest.approx(hit, abs=1e-9)
    assert found["energy"][-1] == pytest.approx(e**2, abs=1e-9)
    angle = hit - e * (2.5 - hit)
    assert [found["a.x"][-1], found["a.y"][-1]] == pytest.approx([np.sin(angle), np.cos(angle)], abs=1e-8)


@pytest.mark.parametrize("place", [1e-6, -1e-6])
@pytest.mark.parametrize("e", [0, 0.5, 1])
def test_an_impact_at_a_crossing_is_no_impact_of_any_energy(place, e):
    # The rows were dependent to rounding: velocities went lost, without a word at -1e-6.
    with pytest.raises(lagcli.SimulationStopped, match=r"within \de-06 of dependent ones") as stopped:
        run(place, e)
    assert stopped.value.stats.stopped.code == "singular-constraints"


def outcome(place, e):
    """The run, and what it said where it stopped."""
    try:
        return run(place, e), ""
    except lagcli.SimulationStopped as stop:
        return stop.trajectory, stop.reason


@pytest.mark.parametrize("place", [1e-3, -1e-3, -1e-4])
def test_a_crossing_close_behind_an_impact_is_passed_or_reported_with_the_impact(place):
    """Rounding decides which; no energy goes lost in either, but what rounding is at 1e-4: 1e-16 over its square."""
    found, told = outcome(place, 1)
    assert not told or "or one too close behind the incident" in told
    assert found["energy"][-1] == pytest.approx(1, abs=1e-7)


def test_what_comes_to_rest_on_a_wall_near_a_crossing_stays():
    found = run(0.01, 0)
    assert np.abs(found["a.y"][found.t > 1.6] - 0.01).max() < 1e-10


RAY = """\
lagcli: 1
parameters: {wall: 1, mass: 2}
particles: {a: {mass: mass, position: [-1, -0.5, 0], velocity: [1, 0.5, 0]}}
forces: {weight: {to: a, force: "[0, 0, -m*(1 + a.y)]"}}
differential: {ray: "a.x*d(a.y) - a.y*d(a.x) = 0"}
inequality:
  floor: a.z >= 0
  wall: {condition: "a.x <= wall", restitution: 0.5}
simulation: {duration: 3, samples: 13}
"""


def test_contacts_are_watched_on_the_level_of_an_integral_across_a_crossing():
    """y/x is enforced, which takes more numbers than the parameters; at x = y = 0 the row vanishes."""
    model = lagcli.loads(RAY)
    found = lagcli.simulate(model)
    assert found.stats.singular_times == pytest.approx([1], abs=1e-6)
    assert list(zip(found.events["kind"], found.events["name"], strict=True)) == [
        ("crossing", "ray"),
        ("impact", "wall"),
    ]
    x = np.where(found.t <= 2, found.t - 1, 1 - 0.5 * (found.t - 2))
    assert found["a.x"] == pytest.approx(x, abs=1e-11)
    assert found["a.y"] == pytest.approx(x / 2, abs=1e-11)
    assert found["lambda.floor"] == pytest.approx(2 * (1 + x / 2), abs=1e-10)
    assert lagcli.audit(model).passed
