"""A table on four legs at rest: the load is shared in more ways than one, legs only push, and all commands agree."""

from __future__ import annotations

import pathlib

import numpy as np
import pytest

import lagcli

pytestmark = pytest.mark.numeric

MODELS = pathlib.Path(__file__).parents[2] / "models"
LEGS = ("ne", "nw", "sw", "se")
SIGNS = np.array([[1, 1, 1], [1, -1, 1], [1, -1, -1], [1, 1, -1.0]])


def table(cx: float, cy: float) -> lagcli.Model:
    """A top on legs at (+-1, +-1) that tilts by small angles, its weight 10 at (cx, cy), with a spring along x."""
    return lagcli.loads(f"""
lagcli: 1
parameters: {{W: 10, cx: {cx}, cy: {cy}}}
coordinates: {{z: {{}}, a: {{}}, b: {{}}, x: {{}}}}
lagrangian: (rate(z)**2 + rate(a)**2 + rate(b)**2 + rate(x)**2)/2 - x**2
forces: {{weight: {{potential: W*(z + a*cx + b*cy)}}}}
inequality:
  ne: z + a + b >= 0
  nw: z - a + b >= 0
  sw: z - a - b >= 0
  se: z + a - b >= 0
simulation: {{duration: 1, samples: 3}}
""")


# Within the middle square all four carry; towards a corner the shortest split would have the far leg pull; on an edge
# two carry, and alone can.
@pytest.mark.parametrize(
    ("cx", "cy", "unique"),
    [
        (0, 0, False),
        (0.3, 0.1, False),
        (0.6, 0.35, False),
        (0.9, 0.85, False),
        (-0.9, 0.85, False),
        (1, 0, True),
    ],
)
def test_legs_share_a_load_as_in_a_run_and_only_push(cx: float, cy: float, unique: bool) -> None:
    model = table(cx, cy)
    found = lagcli.equilibrium(model, starts=2)
    assert len(found) == 1
    point = found[0]
    lam = np.array([point.multipliers[leg] for leg in LEGS])
    assert (lam >= 0).all()
    np.testing.assert_allclose(lam @ SIGNS, [10, 10 * cx, 10 * cy], atol=1e-12)
    assert point.unique_multipliers is unique
    run = lagcli.simulate(model)
    np.testing.assert_allclose([run[f"lambda.{leg}"][-1] for leg in LEGS], lam, atol=1e-11)
    assert (not run.stats.indeterminate) is unique
    # What is left free is the spring, and on an edge a tilt that nothing holds.
    swings = lagcli.modes(model).frequencies
    assert swings is not None
    np.testing.assert_allclose(swings[-1], np.sqrt(2), rtol=1e-12)
    assert len(swings) == (2 if unique else 1)
    assert lagcli.audit(model).passed


def test_a_load_beyond_the_legs_has_no_rest() -> None:
    assert not len(lagcli.equilibrium(table(1.2, 0), starts=2))


def test_a_continuum_and_its_edge_are_one() -> None:
    """The load on a corner: the table stands on that leg at any tilt. An edge of these places is no continuum of its
    own; by rounding a point of it may stand beside them."""
    found = lagcli.equilibrium(table(1, 1), starts=4)
    assert {point.dimension for point in found} <= {0, 2}
    assert [point.dimension for point in found].count(2) == 1


def test_families_of_a_knife_edge_are_told_once() -> None:
    """Along the slope, downwards and upwards, at any place: points far from each other are of one plane."""
    found = lagcli.equilibrium(lagcli.load(MODELS / "knife-edge.yaml"), starts=8)
    assert [point.dimension for point in found] == [2, 2]
    assert sorted(round(np.sin(point.at["phi"]), 9) for point in found) == [-1, 1]
