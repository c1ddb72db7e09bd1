"""Events, outputs and columns of constraint forces that are zero by structure: of a contact that is open."""

import numpy as np
import pytest

import lagcli

pytestmark = pytest.mark.numeric

WHEN = [
    "multiplier(floor)",
    "2*multiplier(floor)",
    "-multiplier(floor)",
    "multiplier(floor)*b.z",
    "multiplier(floor)**2",
    "reaction(b).x",
    "reaction(b).y",
    "reaction(b).z",
    "reaction(c).z*reaction(b).z",
    "0*b.z",
]
# Open until a hop of 0.2 s is over, closed from the start, and never closed.
STARTS = {"open": (0.0, 1.0), "closed": (0.0, 0.0), "free": (5.0, 1.0)}


def hop(height, speed, events, outputs=""):
    return f"""lagcli: 1
particles:
  b: {{mass: 2, position: [0, 0, {height}], velocity: [1, 0, {speed}]}}
  c: {{mass: 1, position: [0, 1, 7], velocity: [1, 0, 0]}}
forces: {{w: {{to: all, force: "[0, 0, -m*10]"}}}}
inequality: {{floor: b.z >= 0}}
outputs: {{out: {outputs or "b.z"}}}
events: {{{events}}}
simulation: {{duration: 0.5, samples: 6}}
"""


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("when", WHEN)
def test_an_event_on_what_is_zero_by_structure_does_no_harm(when, start):
    height, speed = STARTS[start]
    found = lagcli.simulate(lagcli.loads(hop(height, speed, f'off: {{when: "{when}"}}', outputs=f'"{when}"')))
    lands = {"open": 0.2, "closed": 0.0, "free": 9.0}[start]
    flies = found.t < lands
    z = np.where(flies, height + speed * found.t - 5 * found.t**2, 0.0)
    push = np.where(flies, 0.0, 20.0)
    clear = np.abs(found.t - lands) > 1e-9
    assert found["b.z"][clear] == pytest.approx(z[clear], abs=1e-12)
    assert found["lambda.floor"][clear] == pytest.approx(push[clear], abs=1e-11)
    assert found["R.b.z"][clear] == pytest.approx(push[clear], abs=1e-11)
    values = {"reaction(b).z": push, "multiplier(floor)": push, "2*multiplier(floor)": 2 * push}
    if when in values:
        assert found["out"][clear] == pytest.approx(values[when][clear], abs=1e-10)


def test_a_ladder_leaves_the_wall_where_its_multiplier_vanishes():
    """A rod that slides down leaves the wall where its top has come down to 2/3 of its height."""
    text = """lagcli: 1
parameters: {g: 9.81, l: 1, s: 0.3}
coordinates:
  x: {value: l*sin(s)}
  y: {value: l*cos(s)}
  th: {value: s}
lagrangian: (rate(x)**2 + rate(y)**2)/2 + l**2/3*rate(th)**2/2 - g*y
inequality:
  wall: x - l*sin(th) >= 0
  floor: y - l*cos(th) >= 0
events: {off: {when: multiplier(wall), direction: down}}
simulation: {duration: 0.9, samples: 10}
"""
    found = lagcli.simulate(lagcli.loads(text))
    times = [t for t, name in zip(found.events["t"], found.events["name"], strict=True) if name == "off"]
    beside = text.replace("events: {", "events: {high: {when: y - 99}, ")
    both = lagcli.simulate(lagcli.loads(beside))
    others = [t for t, name in zip(both.events["t"], both.events["name"], strict=True) if name == "off"]
    assert len(times) == 1
    assert times == pytest.approx(others, abs=1e-12)
    end = int(np.flatnonzero(found.events["name"] == "off")[0])
    assert found.events["y"][end] == pytest.approx(2 / 3 * np.cos(0.3), abs=1e-11)
