"""Corners where contacts touch and carry nothing: the directions they allow decide the type; edges are told once."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.statics import point_type

pytestmark = pytest.mark.numeric

TRIANGLE = """
lagcli: 1
particles: {a: {mass: 1, position: [0.2, 0.3, 0]}}
holonomic: {flat: a.z = 0}
inequality: {one: a.x + a.y <= 1, two: a.x >= 0, three: a.y >= 0}
"""
CUBE = """
lagcli: 1
particles: {a: {mass: 1, position: [0.2, 0.3, 0.4]}}
inequality: {two: a.x >= 0, three: a.y >= 0, four: a.z >= 0}
"""


def of_corner(text: str, function: str) -> list[tuple[str | None, int]]:
    """Types and dimensions of what is told at the origin."""
    found = lagcli.stationary(lagcli.loads(text), function, starts=6)
    return [(p.type, p.dimension) for p in found if max(map(abs, p.at.values())) < 1e-6]


@pytest.mark.parametrize(
    ("function", "kind", "index"),
    [
        ("a.x**2 + a.y**2 - a.x*a.y/2", "minimum", 0),
        ("a.x**2 + a.y**2 + 3*a.x*a.y", "minimum", 0),  # no minimum of the plane
        ("a.x**2 + a.y**2 - 3*a.x*a.y", "saddle", 1),
        ("-a.x**2 - a.y**2 - 3*a.x*a.y", "maximum", 1),
        ("a.x**2 - a.y**2", "saddle", 1),
        ("a.x**3 + a.y**3", "degenerate", 0),
    ],
)
def test_a_corner_without_forces_has_the_type_of_its_cone(function: str, kind: str, index: int) -> None:
    found = lagcli.stationary(lagcli.loads(TRIANGLE), function, starts=4)
    (corner,) = [p for p in found if abs(p.at["a.x"]) < 1e-6 and abs(p.at["a.y"]) < 1e-6]
    assert (corner.type, corner.index) == (kind, index)
    assert all(corner.multipliers[name] == 0 for name in ("two", "three"))


@pytest.mark.parametrize(("sign", "kind"), [("", "maximum"), ("-", "minimum")])
def test_ends_of_edges_that_balance_are_no_points_of_their_own(sign: str, kind: str) -> None:
    """x y on a triangle: two edges of zeros, the corners their ends, and the middle of the third with 1/4."""
    found = lagcli.stationary(lagcli.loads(TRIANGLE), f"{sign}a.x*a.y", starts=6)
    assert sorted(point.dimension for point in found) == [0, 1, 1]
    (middle,) = [point for point in found if not point.dimension]
    assert middle.type == kind
    assert abs(middle.value) == pytest.approx(0.25)
    assert (middle.at["a.x"], middle.at["a.y"]) == pytest.approx((0.5, 0.5))


def test_the_corner_of_a_cube() -> None:
    """x y z is stationary on the axes, and where one of x, y, z is 0: three faces, which hold the corner. The sum of
    products has the three axes."""
    faces = lagcli.stationary(lagcli.loads(CUBE), "a.x*a.y*a.z", starts=12)
    assert [point.dimension for point in faces] == [2, 2, 2]
    axes = lagcli.stationary(lagcli.loads(CUBE), "a.x*a.y + a.y*a.z + a.z*a.x", starts=12)
    assert [point.dimension for point in axes] == [1, 1, 1]
    assert of_corner(CUBE, "(a.x + a.y + a.z)**2 + a.x*a.y") == [("minimum", 0)]
    assert of_corner(CUBE, "a.x*a.y + a.z**2 - a.y**2 + a.x**2") == [("saddle", 0)]


def test_a_ball_in_a_gutter_rests_where_two_walls_carry_nothing() -> None:
    """Springs of the potential x^2 + y^2 + 3 x y pull it into the corner and would let it go along x = -y."""
    text = TRIANGLE.replace(
        "inequality:", 'forces: {pull: {potential: "a.x**2 + a.y**2 + 3*a.x*a.y"}}\ninequality:'
    )
    found = lagcli.equilibrium(lagcli.loads(text), starts=4)
    assert [(point.type, point.index) for point in found] == [("minimum", 0)]


@pytest.mark.parametrize("seed", range(5))
def test_extremes_on_a_cone_are_those_of_many_directions(seed: int) -> None:
    random = np.random.default_rng(seed)
    H = random.standard_normal((3, 3))
    H, G = H + H.T, random.standard_normal((2 + seed % 3, 3))

    def kind_less(part: float) -> str:
        """The kind of u^T H u - part, for u of length one."""
        return point_type.kind_on_cone(H - part * np.eye(3), G, (0, 0), (False, False))[0]

    u = random.standard_normal((3, 20_000))
    for part in (1.0, 0.1, 0.01, 1e-3, 1e-4):  # nearer and nearer to the best there are
        u = (u / np.linalg.norm(u, axis=0))[:, (G @ u >= 0).all(axis=0)]
        values = np.einsum("ij,ik,kj->j", u, H, u)
        if not values.size:
            assert kind_less(0.0) == "isolated"
            return
        best = u[:, [int(values.argmin()), int(values.argmax())]]
        u = np.hstack([best, *(one[:, None] + part * random.standard_normal((3, 20_000)) for one in best.T)])
    assert [kind_less(values.min() + off) for off in (-1e-3, 1e-3)] == ["minimum", "saddle"]
    assert [kind_less(values.max() + off) for off in (-1e-3, 1e-3)] == ["saddle", "maximum"]
