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


@pytest.mark.parametrize(("cx", "cy", "size"), [(1, 1, 2), (-1, 1, 2), (1, 0.2, 1)])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_continuum_and_its_edge_are_one(cx: float, cy: float, size: int, seed: int) -> None:
    """The load on a corner: the table stands on that leg at any tilt; on a side, on two. The edges of these places, at
    which more legs touch and carry nothing, are no others, from whichever start they are found."""
    found = lagcli.equilibrium(table(cx, cy), starts=4, seed=seed)
    assert [point.dimension for point in found] == [size]


def test_walls_without_room_between_them_leave_no_continuum() -> None:
    """A ball on a table at x = 1, where walls face each other; y is free."""
    found = lagcli.equilibrium(
        lagcli.loads("""
lagcli: 1
particles: {a: {mass: 1, position: [1, 0, 0]}}
forces: {weight: {to: all, force: [0, 0, -9.81*m]}}
inequality: {table: a.z >= 0, left: a.x >= 1, right: 1 >= a.x, back: a.y >= 0}
"""),
        starts=4,
    )
    assert [point.dimension for point in found] == [1]
    assert abs(found[0].at["a.x"] - 1) < 1e-9


def test_families_of_a_knife_edge_are_reported_once() -> None:
    """Along the slope, downwards and upwards, at any place: points far from each other are of one plane."""
    found = lagcli.equilibrium(lagcli.load(MODELS / "knife-edge.yaml"), starts=8)
    assert [point.dimension for point in found] == [2, 2]
    assert sorted(round(np.sin(point.at["phi"]), 9) for point in found) == [-1, 1]
