"""Rows with any factor: the motion and the forces do not depend on it, or the row is refused; never is it ignored."""

from __future__ import annotations

import itertools
import re

import numpy as np
import pytest

import lagcli

pytestmark = pytest.mark.numeric

KINDS = {"holonomic": "{k}*a.z = 0", "differential": "{k}*rate(a.z) = 0", "inequality": "{k}*a.z >= 0"}


def model(kind: str, k: str, mass: str = "1", assemble: bool = False) -> lagcli.Model:
    return lagcli.loads(
        f"""lagcli: 1
particles: {{a: {{mass: {mass}, position: [0, 0, 0], velocity: [1, 0, 0]}}}}
forces: {{weight: {{to: a, force: [0, 0, -9.81*m]}}}}
{kind}: {{c: "{KINDS[kind].format(k=k)}"}}
simulation: {{duration: 1.2, samples: 3, assemble: {str(assemble).lower()}}}
"""
    )


@pytest.mark.parametrize(("kind", "k"), itertools.product(KINDS, ["1e140", "1e-140"]))
def test_the_multiplier_carries_the_factor(kind: str, k: str) -> None:
    found = lagcli.simulate(model(kind, k))
    assert np.abs(found["a.z"]).max() < 1e-13
    assert found["lambda.c"] * float(k) == pytest.approx([9.81] * 3, rel=1e-12)
    assert found["R.a.z"] == pytest.approx([9.81] * 3, rel=1e-12)


@pytest.mark.parametrize(("kind", "k"), itertools.product(KINDS, ["1e300", "1e160", "1e-160", "1e-300"]))
def test_a_row_whose_square_is_no_number_is_refused_by_name(kind: str, k: str) -> None:
    with pytest.raises(
        lagcli.ModelError, match=re.escape(f"the gradient of `c` is {float(k):.3g}: its square")
    ) as caught:
        lagcli.simulate(model(kind, k))
    (diagnostic,) = caught.value.diagnostics
    assert (diagnostic.code, diagnostic.location.line) == ("not-finite-at-start", 4)


def test_an_assembled_start_is_refused_too() -> None:
    with pytest.raises(lagcli.ModelError, match="its square is beyond"):
        lagcli.simulate(model("holonomic", "1e300", assemble=True))


@pytest.mark.parametrize(("k", "mass"), [("1e140", "1e-100"), ("1e-140", "1e100")])
def test_the_square_is_taken_in_units_of_the_inertia(k: str, mass: str) -> None:
    with pytest.raises(lagcli.ModelError, match="in units of the inertia: its square"):
        lagcli.simulate(model("holonomic", k, mass))


def test_factors_of_all_sizes_stand_in_one_model() -> None:
    text = """lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0]}
  b: {mass: 2, position: [1, 0, 0]}
forces: {weight: {to: all, force: [0, 0, -9.81*m]}}
holonomic: {c: 1e140*a.z = 0, d: 1e-140*(b.z - a.z) = 0}
simulation: {duration: 1, samples: 3}
"""
    found = lagcli.simulate(lagcli.loads(text))
    assert found["lambda.d"] * 1e-140 == pytest.approx([19.62] * 3, rel=1e-12)
    assert found["lambda.c"] * 1e140 == pytest.approx([29.43] * 3, rel=1e-12)
    assert max(np.abs(found["a.z"]).max(), np.abs(found["b.z"]).max()) < 1e-13


@pytest.mark.parametrize("k", ["1e300", "1e-300"])
def test_a_count_does_not_depend_on_the_factor(k: str) -> None:
    assert lagcli.dof(model("holonomic", k)).velocity_dof == 2


STACK = """lagcli: 1
particles:
  a: {{mass: 1, position: [0, 0, {z}]}}
  b: {{mass: {M}, position: [0, 0, 1.5]}}
forces: {{weight: {{to: all, force: [0, 0, -9.81*m]}}}}
inequality:
  floor: {{condition: a.z >= 0, restitution: {e}}}
  pair: {{condition: b.z - a.z >= 1, restitution: {e}}}
simulation: {{duration: 1, samples: 11}}
"""


@pytest.mark.parametrize(("M", "e"), itertools.product(["1e3", "1e7"], [0, 0.5]))
def test_a_heavy_ball_comes_to_rest_on_a_light_one(M: str, e: float) -> None:
    found = lagcli.simulate(lagcli.loads(STACK.format(M=M, e=e, z=0.5)))
    weight = 9.81 * float(M)
    assert [found["lambda.pair"][-1], found["lambda.floor"][-1]] == pytest.approx(
        [weight, weight + 9.81], rel=1e-8
    )
    assert [found["a.z"][-1], found["b.z"][-1]] == pytest.approx([0, 1], abs=1e-12)


@pytest.mark.parametrize(("M", "e"), itertools.product(["1e10", "1e12", "1e15"], [0, 0.5]))
def test_inertias_that_differ_by_ten_digits_are_the_reason_of_a_stop_at_contacts(M: str, e: float) -> None:
    with pytest.raises(
        lagcli.SimulationStopped, match=r"inertias that differ by so much.*`floor`, `pair`"
    ) as caught:
        lagcli.simulate(lagcli.loads(STACK.format(M=M, e=e, z=0.5)))
    found, fall = caught.value.trajectory, np.sqrt(2 * 0.5 / 9.81)
    assert caught.value.t >= fall * (1 - 1e-12)
    t = found["t"][found["t"] < fall]
    assert found["b.z"][: t.size] == pytest.approx(1.5 - 9.81 / 2 * t**2, abs=1e-12)


def test_a_count_stands_where_a_row_over_its_inertia_is_beyond_the_range_of_numbers() -> None:
    text = """lagcli: 1
particles:
  a: {mass: 1e-300, position: [0, 0, 0], velocity: [1, 0, 0]}
  b: {mass: 1, position: [1, 0, 0], velocity: [1, 0, 0]}
holonomic: {c: 1e300*a.z = 0, d: b.z - a.z = 0, e: b.z + a.z = 0}
"""
    assert lagcli.dof(lagcli.loads(text)).velocity_dof == 4
