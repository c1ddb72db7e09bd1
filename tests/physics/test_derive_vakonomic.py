"""The lines of `derive` about the other principle, against equations worked out by hand."""

from __future__ import annotations

import lagcli

TITLE = "The other principle: vakonomic motion"


def lines(text: str) -> list[tuple[str, str, str]]:
    """Left, right and number of the equations of the section."""
    found = lagcli.derive(lagcli.loads(text)).as_json()
    own = [line for line in found if line["section"] == TITLE and line["left"]]
    return [(str(line["left"]), str(line["right"]), str(line["equation"])) for line in own]


def test_knife_edge() -> None:
    """d/dt (m x' + mu sin phi) = 0, d/dt (m y' - mu cos phi) = 0, J phi'' = mu (x' cos phi + y' sin phi)."""
    found = lines(
        "lagcli: 1\nparameters: {m: 1, J: 2}\ncoordinates: {x: {rate: 1}, y: {}, phi: {}}\n"
        "lagrangian: m/2*(rate(x)**2 + rate(y)**2) + J/2*rate(phi)**2\n"
        "differential: {edge: sin(phi)*rate(x) - cos(phi)*rate(y) = 0}\n"
    )
    assert found == [
        ("m ẍ + μ_edge φ̇ cos φ + μ̇_edge sin φ", "0", "D.39"),
        ("m ÿ + μ_edge φ̇ sin φ − μ̇_edge cos φ", "0", "D.39"),
        ("J φ̈ − μ_edge (ẋ cos φ + ẏ sin φ)", "0", "D.39"),
    ]


def test_particle_with_a_row_that_moves_and_a_holonomic_one() -> None:
    """phi = z' - (y + t) x': x'' - d/dt((y + t) mu), y'' + mu x', z'' + mu', with lambda of the plane."""
    found = lines(
        "lagcli: 1\nparticles: {a: {mass: 1, position: [0, 0, 0], velocity: [1, 0, 0]}}\n"
        "holonomic: {plane: a.x = t}\ndifferential: {row: a.vz - (a.y + t)*a.vx = 0}\n"
    )
    (x, _, number), (y, zero, _), (z, _, _) = found
    assert number == "D.53"
    assert x == "ẍ_a − μ_row (ẏ_a + 1) − μ̇_row (y_a + t)"
    assert y == "ÿ_a + μ_row ẋ_a"
    assert zero == "0"
    assert z == "z̈_a + μ̇_row"


def test_no_section_without_differential_rows_or_with_forces_that_are_in_no_action() -> None:
    ball = "lagcli: 1\nparticles: {a: {mass: 1, position: [1, 0, 0], velocity: [0, 1, 0]}}\n"
    row = "differential: {row: a.vz = a.y*a.vx}\n"
    assert not lines(ball + "holonomic: {rod: norm(a) = 1}\n")
    assert lines(ball + row)
    assert lines(ball + row + "forces: {push: {to: a, force: '[sin(t), 0, 0]'}}\n")
    assert not lines(ball + row + "forces: {drag: {to: a, force: -v}}\n")
    assert not lines(ball + row + "inequality: {floor: a.z >= -9}\n")


def test_where_the_section_is_left_out_it_says_why() -> None:
    ball = "lagcli: 1\nparticles: {a: {mass: 1, position: [1, 0, 0], velocity: [0, 1, 0]}}\n"
    row = "differential: {row: a.vz = a.y*a.vx}\n"
    for more, why in (
        ("forces: {drag: {to: a, force: -v}}\n", "may be in no action"),
        ("inequality: {floor: a.z >= -9}\n", "one-sided constraints push"),
    ):
        assert why in " ".join(lagcli.derive(lagcli.loads(ball + row + more)).text().split())
    assert "Not written out" not in lagcli.derive(lagcli.loads(ball + row)).text().split(TITLE)[1]
    assert TITLE not in lagcli.derive(lagcli.loads(ball + "forces: {drag: {to: a, force: -v}}\n")).text()
