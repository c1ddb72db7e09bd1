"""Types of points at which gradients of contacts depend on each other: many multipliers balance one force."""

import numpy as np
import pytest

import lagcli

MODEL = """
lagcli: 1
coordinates: {{x: {{value: 0.1}}, y: {{value: 0.1}}}}
lagrangian: (rate(x)**2 + rate(y)**2)/2
inequality: {{{walls}}}
"""
ALL = ("x >= 0", "y >= 0", "x + y <= 0")  # the origin alone
LINE = ("x >= 0", "x <= 0")
PARABOLAS = ("y >= x**2", "y >= -x**2")


def at_origin(function: str, walls: tuple[str, ...]) -> list[str | None]:
    text = ", ".join(f"c{k}: {wall}" for k, wall in enumerate(walls))
    report = lagcli.stationary(lagcli.loads(MODEL.format(walls=text)), function)
    return [point.type for point in report if np.hypot(*point.at.values()) < 1e-9]


@pytest.mark.parametrize("function", ["x", "x - 2*y", "x + y", "-x - y", "x**2 + y", "x*y - 3*y"])
def test_the_only_configuration_that_contacts_leave_is_isolated(function):
    assert at_origin(function, ALL) == ["isolated"]


@pytest.mark.parametrize(
    ("function", "kind"),
    [
        ("x + y**2", "minimum"),
        ("x - y**2", "maximum"),
        ("-x - y**2", "maximum"),
        ("-x + y**2", "minimum"),
        ("x + y**3", "saddle"),
        ("x + y**4", "minimum"),
    ],
)
def test_between_two_walls_that_leave_a_line_the_function_on_it_decides(function, kind):
    assert at_origin(function, LINE) == [kind]


@pytest.mark.parametrize("walls", [PARABOLAS, PARABOLAS[::-1], (*PARABOLAS, "y >= -2*x**2")])
@pytest.mark.parametrize(
    ("function", "kind"),
    # On y >= x^2 the least of y - c x^2 along the wall is (1 - c) x^2.
    [("y", "minimum"), ("y - x**2/2", "minimum"), ("y - 2*x**2", "saddle"), ("-y - x**2", "maximum")],
)
def test_of_walls_that_touch_each_other_the_nearest_one_decides(walls, function, kind):
    assert at_origin(function, walls) == [kind]


@pytest.mark.parametrize(
    ("function", "kind"),
    [("x + y", "minimum"), ("2*x + y", "minimum"), ("-x - 3*y", "maximum"), ("x - y", "saddle")],
)
def test_a_third_wall_through_a_corner_changes_no_type(function, kind):
    assert at_origin(function, ("x >= 0", "y >= 0", "x + y >= 0")) == [kind]
