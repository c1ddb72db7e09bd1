"""Multipliers of deviations over a period, against closed forms and another integration."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate, special

import lagcli
from lagcli.api.find_modes import NoEquilibriumError

MATHIEU = """\
lagcli: 1
parameters: {a: 1.3, e: 0.4, c: 0}
coordinates: {x: {}}
lagrangian: rate(x)**2/2 - (a + e*cos(2*t))*x**2/2
forces: {drag: {to: x, force: -c*rate(x)}}
"""
CONE = """\
lagcli: 1
parameters: {g: 9.81, a: 0.7, W: sqrt(g/cos(a))}
particles: {p: {mass: 2, position: ["sin(a)", 0, "-cos(a)"], velocity: [0, "W*sin(a)", 0]}}
forces: {weight: {to: p, force: [0, 0, -m*g]}}
holonomic: {rod: norm(p) = 1}
"""
SWING = """\
lagcli: 1
parameters: {g: 9.81}
coordinates: {th: {value: 1.2}}
lagrangian: rate(th)**2/2 + g*cos(th)
simulation: {duration: 5}
"""


def modes(text: str, about: str = "auto", **parameters: float) -> lagcli.Modes:
    return lagcli.modes(lagcli.loads(text, parameters=parameters), about=about)


def mathieu(a: float, e: float, c: float) -> np.ndarray:
    """The multipliers of x'' + c x' + (a + e cos 2t) x = 0 by integration of its own."""

    def rate(t: float, y: np.ndarray) -> list[float]:
        k = a + e * np.cos(2 * t)
        return [y[1], -c * y[1] - k * y[0], y[3], -c * y[3] - k * y[2]]

    found = integrate.solve_ivp(
        rate,
        (0, np.pi), [1, 0, 0, 1], "DOP853", rtol=1e-12, atol=1e-13,
    ).y[:, -1]  # fmt: skip
    return np.linalg.eigvals(found.reshape(2, 2).T)


@pytest.mark.parametrize(("e", "c", "stable"), [(0.4, 0.0, None), (1.6, 0.0, False), (0.4, 0.3, True)])
def test_a_pendulum_with_a_beating_spring(e: float, c: float, stable: bool | None) -> None:
    found = modes(MATHIEU, e=e, c=c)
    assert found.about == "periodic"
    assert found.period == pytest.approx(np.pi, rel=1e-12)
    wanted = mathieu(1.3, e, c)
    assert found.multipliers is not None
    for z in wanted:
        assert np.abs(found.multipliers - z).min() < 1e-9
    assert found.stable is stable
    np.testing.assert_allclose(np.exp(found.eigenvalues * found.period), found.multipliers, rtol=1e-12)


def test_a_conical_pendulum_in_space_comes_back_and_turns_on_its_circle() -> None:
    """w^2 = W^2 (1 + 3 cos^2 a); displaced along the circle, and on a wider one that is slower, it has two 1."""
    found = modes(CONE)
    W = np.sqrt(9.81 / np.cos(0.7))
    assert found.about == "periodic"
    assert found.period == pytest.approx(2 * np.pi / W, rel=1e-10)
    angle = 2 * np.pi * np.sqrt(1 + 3 * np.cos(0.7) ** 2)
    np.testing.assert_allclose(
        sorted(found.multipliers, key=lambda z: (z.real, z.imag)),
        sorted([1, 1, np.exp(1j * angle), np.exp(-1j * angle)], key=lambda z: (z.real, z.imag)),
        atol=1e-9,
    )


def test_a_large_swing_comes_back_where_it_is_asked_for_and_else_gives_way_to_the_equilibrium() -> None:
    found = modes(SWING, "start")
    assert found.period == pytest.approx(4 / np.sqrt(9.81) * special.ellipk(np.sin(0.6) ** 2), rel=1e-9)
    assert found.multipliers.tolist() == [1, 1]
    small = modes(SWING)
    assert small.about == "equilibrium"
    np.testing.assert_allclose(small.frequencies, [np.sqrt(9.81)], rtol=1e-12)
    # That another answer is to be had is told where nothing was asked for, and there alone.
    assert any("comes back" in note and "--about start" in note for note in small.notes)
    assert not any("comes back" in note for note in modes(SWING, "equilibrium").notes)


def test_a_shaft_with_two_stiffnesses_whirls_between_them() -> None:
    """In the frame that turns, s^4 + s^2 (k1 + k2 + 2 W^2) + (k1 - W^2)(k2 - W^2) = 0: unstable in between."""
    text = """\
lagcli: 1
parameters: {k1: 4, k2: 9, W: 2.5}
coordinates: {x: {}, y: {}, turn: {rate: W}}
lagrangian: >-
  (rate(x)**2 + rate(y)**2 + rate(turn)**2)/2
  - k1*(x*cos(turn) + y*sin(turn))**2/2 - k2*(y*cos(turn) - x*sin(turn))**2/2
"""
    found = modes(text)
    W = 2.5
    square = max(np.roots([1, 13 + 2 * W**2, (4 - W**2) * (9 - W**2)]).real)
    assert found.about == "periodic"
    assert found.period == pytest.approx(np.pi / W, rel=1e-9)
    assert found.growth == pytest.approx(np.sqrt(square), rel=1e-9)
    assert found.stable is False


def test_what_does_not_come_back_is_refused() -> None:
    with pytest.raises(NoEquilibriumError, match="does not come back"):
        modes("lagcli: 1\ncoordinates: {x: {value: 1}}\nlagrangian: rate(x)**2/2 - exp(x)\n", "start")
    many = """
lagcli: 1
particles:
  p[i]: {for: "i = 1..21", mass: 1, position: "[i, 0, 0]"}
forces:
  fall[i]: {for: "i = 1..21", potential: "exp(p[i].x)"}
"""
    with pytest.raises(NoEquilibriumError, match="up to 60 coordinates: this one has 63"):
        modes(many, "start")
    with pytest.raises(ValueError, match="about: "):
        modes(SWING, "somewhere")
