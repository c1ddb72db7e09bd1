"""Contacts whose rows depend on one another, and on equality rows: the motion is unique, and how a load is shared."""

import itertools
import pathlib

import numpy as np
import pytest

import lagcli

pytestmark = pytest.mark.numeric

PILE = pathlib.Path(__file__).parents[2] / "models" / "sphere-pile.yaml"

PLATE = """lagcli: 1
particles:
  a: {mass: 1, position: [-1, -1, 0]}
  b: {mass: 1, position: [1, -1, 0]}
  c: {mass: 1, position: [1, 1, 0]}
  d: {mass: 1, position: [-1, 1, 0]}
forces:
  weight: {to: all, force: "[0, 0, -m*10]"}
  load: {to: a, force: "[0, 0, -60*t]"}
  other: {to: c, force: "[0, 0, -60*(1 - t)]"}
rigid:
  plate: [a, b, c, d]
inequality:
  la: a.z >= 0
  lb: b.z >= 0
  lc: c.z >= 0
  ld: d.z >= 0
"""


def test_a_pile_of_which_all_contacts_are_declared_twice():
    text = PILE.read_text(encoding="utf-8").replace("N: 10", "N: 3")
    contacts = text.partition("inequality:\n")[2].partition("simulation:")[0]
    again = "".join(f"  again_{line.strip()}\n" for line in contacts.splitlines())
    once = lagcli.simulate(lagcli.loads(text), duration=0.5, samples=11)
    twice = lagcli.simulate(lagcli.loads(text.replace("simulation:", again + "simulation:")), samples=11)
    for name in ("p[3].z", "p[2].vz", "R.p[2].x"):
        assert np.abs(twice[name] - once[name]).max() < 1e-9
    for name in ("floor[1]", "left[3]", "pair[1][2]"):
        each = once[f"lambda.{name}"] / 2
        assert np.abs(twice[f"lambda.{name}"] - each).max() < 1e-9
        assert np.abs(twice[f"lambda.again_{name}"] - each).max() < 1e-9
    assert twice.stats.impacts == 2 * once.stats.impacts


def test_a_load_that_wanders_over_a_table():
    found = lagcli.simulate(lagcli.loads(PLATE), duration=1.0, samples=11)
    a, b, c, d = (found[f"lambda.{leg}"] for leg in ("la", "lb", "lc", "ld"))
    t = found.t
    assert np.abs(a + b + c + d - 100).max() < 1e-9
    # Moments about the diagonals, and the same share of each row in what is free.
    assert np.abs(b - d).max() < 1e-9
    assert np.abs(a - c - 60 * t + 60 * (1 - t)).max() < 1e-9
    assert len(found.events["t"]) == 0


def test_redundant_equality_rows_share_a_blow():
    model = """lagcli: 1
particles:
  a: {mass: 2, position: [0, 0, 1], velocity: [0, 0, -1]}
  b: {mass: 2, position: [1, 0, 1], velocity: [0, 0, -1]}
forces: {weight: {to: all, force: "[0, 0, -m*10]"}}
holonomic: {rod: a.z = b.z, twice: 2*a.z = 2*b.z}
inequality:
  floor: {condition: "a.z >= 0", restitution: 0.5}
"""
    found = lagcli.simulate(lagcli.loads(model), duration=1.0, samples=11)
    speed = 21**0.5
    rod, twice = (found.events[f"impulse.{name}"][0] for name in ("rod", "twice"))
    # b gets 2*1.5*speed through both rows, of which mu_i = lambda_i |B_i| is the same.
    assert rod + 2 * twice == pytest.approx(-3 * speed, rel=1e-12)
    assert rod == pytest.approx(2 * twice, rel=1e-12)


def shortest_split(rows, load):
    """lambda >= 0 of rows (k, n) with rows^T lambda = load (n,), and the least sum of lambda_i^2 |row_i|^2."""
    lengths = np.linalg.norm(rows, axis=1)
    unit = rows / lengths[:, None]
    best = None
    for count in range(1, len(rows) + 1):
        for held in map(list, itertools.combinations(range(len(rows)), count)):
            mu = np.zeros(len(rows))
            mu[held] = np.linalg.lstsq(unit[held].T, load, rcond=1e-12)[0]
            fits = mu.min() > -1e-12 and np.abs(unit.T @ mu - load).max() < 1e-10
            if fits and (best is None or mu @ mu < best @ best - 1e-13):
                best = mu
    return best / lengths


def test_contacts_that_carry_nothing_are_loaded_again():
    found = lagcli.simulate(lagcli.loads(PLATE.replace("60*", "160*")), duration=1.0, samples=21)
    a, b, c, d = (found[f"lambda.{leg}"] for leg in ("la", "lb", "lc", "ld"))
    # z of the four particles: legs, and the row by which the plate ties d to the others, of either sign.
    tie = np.array([1.0, -1.0, 1.0, -1.0])
    rows = np.vstack([np.eye(4), tie, -tie])
    for i, t in enumerate(found.t):
        want = shortest_split(rows, np.array([10 + 160 * t, 10, 10 + 160 * (1 - t), 10]))
        assert np.abs(np.array([a[i], b[i], c[i], d[i]]) - want[:4]).max() < 1e-9
    assert a[0] == 0 < a[-1]
    assert c[-1] == 0 < c[0]
    # They lie on the floor all the time.
    assert len(found.events["t"]) == 0


def test_walls_of_a_corner_take_turns():
    model = """lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0]}
forces: {pull: {to: a, force: "[cos(t), sin(t), 0]"}}
inequality:
  x: a.x <= 0
  y: a.y <= 0
  both: 2*a.x + 2*a.y <= 0
  steep: 2*a.x + a.y <= 0
  flat: a.z >= 0
"""
    found = lagcli.simulate(lagcli.loads(model), duration=1.57, samples=30)
    rows = np.array([[1.0, 0.0], [0.0, 1.0], [2.0, 2.0], [2.0, 1.0]])
    for i, t in enumerate(found.t):
        want = shortest_split(rows, np.array([np.cos(t), np.sin(t)]))
        got = [found[f"lambda.{name}"][i] for name in ("x", "y", "both", "steep")]
        assert np.abs(np.array(got) - want).max() < 1e-9
    assert {"steep", "x"} <= set(found.stats.indeterminate)


def test_rows_that_are_dependent_at_an_instant_alone_do_not_end_the_run():
    model = """lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, START]}
forces: {weight: {to: all, force: "[0.5, 0, -m*10]"}}
holonomic: {plane: a.y = 0}
inequality:
  floor: a.z >= 0
  bowl: a.z >= a.x**2
"""
    alone = model.replace("  floor: a.z >= 0\n", "")
    for start in ("0", "0.05"):
        with_floor = lagcli.simulate(lagcli.loads(model.replace("START", start)), duration=2, samples=21)
        without = lagcli.simulate(lagcli.loads(alone.replace("START", start)), duration=2, samples=21)
        assert np.abs(with_floor["a.x"] - without["a.x"]).max() < 1e-8
        assert np.abs(with_floor["lambda.bowl"] - without["lambda.bowl"])[2:].max() < 1e-7
