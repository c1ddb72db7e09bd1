"""Gaps over a box of states: no gap in it is below its floor, and steps that are clear of it cost next to nothing."""

import numpy as np
import pytest

import lagcli
from lagcli.compiled import NumericSystem, contact_kinds
from lagcli.equations import system
from lagcli.simulation.events.watch_functions import WatchFunctions

CONDITIONS = (
    "a.x + 2*a.y - 3*a.z*c >= -20",
    "distance(a, b) >= 0.3",
    "norm([a.x - b.x, a.y*b.y, sin(2*t)]) + 1 >= 0.2",
    "a.x**2 - a.y**3 + abs(b.z) >= -9",
    "a.x/(4 + b.x**2) + exp(-a.y) >= -2",
    "cos(3*a.x)*sin(b.y - t) + 2 >= 0",
    "min(a.x, b.x) - max(a.y, -b.z) + 5 >= 0",
    "sqrt(5 + a.x*b.y)*tanh(b.z) >= -7",
)
MODEL = """lagcli: 1
parameters: {c: 1.5}
particles:
  a: {mass: 1, position: [0.4, 0.2, 0.3]}
  b: {mass: 1, position: [-0.5, 0.6, 0.1]}
inequality:
"""
FAR = """lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 1], velocity: [1, 2, 3]}
forces: {weight: {to: a, force: [0, 0, -9.81]}}
inequality:
  wall: a.x <= 100
  floor: a.z >= HEIGHT
simulation: {duration: 1, samples: 3}
"""


def test_no_gap_in_a_box_is_below_its_floor() -> None:
    """And of a small box the floor is near the gap."""
    text = MODEL + "".join(f"  c{i}: '{each}'\n" for i, each in enumerate(CONDITIONS))
    built = system.build(lagcli.loads(text))
    functions, p = NumericSystem(built), system.values(built)
    random = np.random.default_rng(5)
    for width in (1e-6, 0.1, 1.0):
        for _ in range(20):
            t, q = 3 * random.random(), random.standard_normal(6)
            reach = width * random.random(6)
            bounds = functions.gap_floors(t, t + width, q - reach, q + reach, p)
            floors = np.array(bounds).ravel()
            y = np.zeros(13)
            for part in random.random((30, 7)):
                y[:6] = q + (2 * part[:6] - 1) * reach
                g = np.array(functions.gaps(t + width * part[6], y, p)).ravel()
                assert (g >= floors - 1e-12).all()
            if width == 1e-6:
                assert g == pytest.approx(floors, abs=3e-4)


def test_of_what_may_have_a_pole_in_the_box_nothing_is_said() -> None:
    text = MODEL + "  c0: '1/(a.x - b.x) >= -1e6'\n  c1: 'log(a.x + 0.5) >= -1e6'\n"
    built = system.build(lagcli.loads(text))
    bounds = NumericSystem(built).gap_floors(0, 1, -np.ones(6), np.ones(6), system.values(built))
    assert not (np.array(bounds) > 0).any()


def test_steps_far_from_all_contacts_are_looked_at_no_closer(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(_: WatchFunctions) -> None:
        raise LookupError("a step was looked at")

    monkeypatch.setattr(WatchFunctions, "screen", property(refused))
    assert len(lagcli.simulate(lagcli.loads(FAR.replace("HEIGHT", "-100")))["t"]) == 3
    with pytest.raises(LookupError):
        lagcli.simulate(lagcli.loads(FAR.replace("HEIGHT", "0")))


def test_of_many_gaps_those_that_are_not_clear_are_searched_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """And the impacts are the same."""
    model = lagcli.loads(FAR.replace("HEIGHT", "0"))
    usual = lagcli.simulate(model, duration=3.0, samples=4)
    monkeypatch.setattr(contact_kinds.ContactKindParameters, "many", 0)
    many = lagcli.simulate(model, duration=3.0, samples=4)
    assert usual.stats.impacts == many.stats.impacts >= 1
    assert (usual["a.z"] == many["a.z"]).all()
