"""Counts of rows with abs, sign, min and max: those of the same law written on the branch of the start."""

import pytest

import lagcli

pytestmark = pytest.mark.numeric

START = {"x": 0.5, "y": 1.0, "z": 0.0, "w": 0.2}
TURNING = "d(w) - (y - 1)*x*d(z) = 0"


def counted(holonomic, differential, values=None):
    lines = ["lagcli: 1", "coordinates:"]
    lines += [f"  {name}: {{value: {value!r}}}" for name, value in (START | (values or {})).items()]
    lines += ["lagrangian: " + " + ".join(f"rate({name})**2/2" for name in START)]
    for title, laws in (("holonomic", holonomic), ("differential", differential)):
        lines += [f"{title}:"] * bool(laws) + [f'  {title[0]}{i}: "{law}"' for i, law in enumerate(laws)]
    return lagcli.dof(lagcli.loads("\n".join(lines) + "\n"))


def freedoms(*laws):
    count = counted(*laws)
    return count.configuration_dof, count.velocity_dof, count.reason


@pytest.mark.parametrize(
    ("switching", "smooth"),
    [
        ("max(y - 1, -3 - y) = 0", "y = 1"),
        ("min(y - 1, 3 + y) = 0", "y = 1"),
        ("max(min(y - 1, 3 + y), -5) = 0", "y = 1"),
        ("max(abs(y) - 1, -3 - y) = 0", "y = 1"),
        ("abs(max(y, -3 - y)) = 1", "y = 1"),
        ("sign(max(y, -2))*(y - 1) = 0", "y = 1"),
        ("max(max(x - 0.5, 0), y) = 1", "y = 1"),
        ("max(y - 1, 0.499 - x) = 0", "y = 1"),
        ("max(x**2 + y**2, y) = 1.25", "x**2 + y**2 = 1.25"),
    ],
)
@pytest.mark.parametrize("turning", [TURNING, "d(w) - y*x*d(z) = 0", "d(w) - max(x, -y)*d(z) = 0"])
def test_rows_that_switch_elsewhere_count_as_their_branch(switching, smooth, turning):
    assert freedoms([switching], [turning]) == freedoms([smooth], [turning.replace("max(x, -y)", "x")])


@pytest.mark.parametrize(("x", "expected"), [(1e-3, (4, 3, "")), (-1e-3, (3, 3, "")), (1e-12, (4, 3, ""))])
def test_beside_a_kink_its_side_counts(x, expected):
    assert freedoms([], ["d(w) - max(x, min(x, 0)/2, 0)*d(z) = 0"], {"x": x}) == expected


def test_a_start_on_a_kink_whose_sides_differ_is_told():
    count = counted([], ["d(w) - max(x, 0)*d(z) = 0"], {"x": 0.0})
    assert count.configuration_dof is None
    assert "on a kink" in count.reason


@pytest.mark.parametrize("coefficient", ["max(x, 2*x)", "abs(x) + 3*x", "abs(x) - abs(-x) + x"])
def test_on_a_kink_each_side_is_taken_as_a_whole(coefficient):
    """No side has |x| = x and |-x| = -x together."""
    assert freedoms([], [f"d(w) - ({coefficient})*d(z) = 0"], {"x": 0.0}) == (4, 3, "")


@pytest.mark.parametrize("coefficient", ["abs(x) + abs(y) - abs(x + y)", "abs(x) + abs(y) - abs(x - y)"])
def test_of_two_kinks_that_meet_all_sides_count(coefficient):
    """The coefficient is zero on a quarter or more of the plane around the start."""
    count = counted([], [f"d(w) - ({coefficient})*d(z) = 0"], {"x": 0.0, "y": 0.0})
    assert count.configuration_dof is None
    assert "on a kink" in count.reason
