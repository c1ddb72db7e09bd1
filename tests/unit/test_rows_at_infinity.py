"""Rows that come near one another only further and further off have no configuration."""

from __future__ import annotations

import pytest

import lagcli

pytestmark = pytest.mark.numeric


def model(rows: tuple[str, ...], x: str = "0.5", y: str = "1") -> lagcli.Model:
    laws = ", ".join(f'h{i}: "{row}"' for i, row in enumerate(rows))
    return lagcli.loads(
        f"lagcli: 1\ncoordinates: {{x: {{value: {x}}}, y: {{value: {y}}}}}\n"
        f"lagrangian: rate(x)**2 + rate(y)**2\nholonomic: {{{laws}}}\n"
        "simulation: {assemble: true, duration: 0.1}\n"
    )


@pytest.mark.parametrize(
    ("rows", "x"),
    [
        (("x*exp(y) = 1", "x = 0"), "0.5"),
        (("x*y = 1", "x = 0"), "0"),
        (("x*y = 1", "x = 0"), "0.5"),
        (("x**2*y = 1", "x = 0"), "0.5"),
        (("tanh(x) = 1",), "0.5"),
        (("1/x = 0",), "0.5"),
        (("atan(x) = pi/2",), "0.5"),
        (("exp(-x) = 0",), "0.5"),
        (("y = sqrt(1 + x**2)", "y = x"), "0.5"),
        (("y = exp(-x**2)", "y = 0"), "0.5"),
    ],
)
def test_rows_that_are_met_at_infinity_have_no_configuration(rows: tuple[str, ...], x: str) -> None:
    for ask in (lagcli.dof, lagcli.check, lagcli.simulate):
        with pytest.raises(lagcli.ModelError, match="no configuration near the start was found"):
            ask(model(rows, x))


@pytest.mark.parametrize(
    ("rows", "truth"),
    [
        (("x*exp(y) = 1", "x = 0.001"), 0),
        (("x*y = 1", "x = 1e-2"), 0),
        (("x = 0", "y = 1e6"), 0),
        (("y = x**2", "y = 1e6"), 0),
        (("tanh(x) = 0.999",), 1),
        (("(x - 1000)**2 + (y - 1000)**2 = 1", "x = 1000.5"), 0),
        (("y = 1e5", "y + x = 1e5 + 3", "x = 3"), 0),
    ],
)
def test_rows_that_meet_far_off_have_one(rows: tuple[str, ...], truth: int) -> None:
    assert lagcli.dof(model(rows)).configuration_dof == truth
