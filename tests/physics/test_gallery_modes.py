"""Modes of the gallery: closed forms and published numbers, and a small push that is let go in `simulate`."""

from __future__ import annotations

import dataclasses
import pathlib

import numpy as np
import pytest

import lagcli
from lagcli.equations import system
from lagcli.running import table_columns

pytestmark = pytest.mark.numeric

MODELS = pathlib.Path(__file__).parents[2] / "models"
# The models that have an equilibrium with a mode that is not zero, and linear equations that do not depend on t.
RESTING = [
    "bead-on-rotating-hoop", "bicycle", "braced-square", "breaking-rod", "bricard", "buckling-column", "chain", "cloth",
    "co2-vibrations", "hanging-chain", "sphere-fall-off",
    "conical-pendulum", "double-four-bar", "double-pendulum", "double-pendulum-angles", "pendulum", "pendulum-angle",
    "poincare-section", "rope-slack-and-taut", "spherical-pendulum", "spring-lattice", "triangle-on-sphere",
    "twin-rod", "water-vibrations",
]  # fmt: skip
PUSH = 1e-5


def modes(name: str, about: str = "auto", **parameters: float) -> lagcli.Modes:
    return lagcli.modes(lagcli.load(MODELS / f"{name}.yaml", parameters), about=about)


def pushed(
    name: str, found: lagcli.Modes, shape: np.ndarray, duration: float, **parameters: float
) -> np.ndarray:
    """Deviations (n,) of places a time after a push of velocities, to first order: of two pushes, forth and back."""
    model = lagcli.load(MODELS / f"{name}.yaml", parameters)
    forth, back = (away(model, found, sign * shape, duration) for sign in (1.0, -1.0))
    return (forth - back) / 2


def away(model: lagcli.Model, found: lagcli.Modes, shape: np.ndarray, duration: float) -> np.ndarray:
    """Deviations (n,) of places a time after a push from the equilibrium."""
    q = np.array([found.at[column] for column in found.coordinates])
    settings = dataclasses.replace(
        model.simulation,
        duration=duration,
        samples=2,
        output_step=None,
        rtol=1e-11,
        atol=None,
        assemble=False,
        keep=(),
    )
    run = lagcli.simulate(dataclasses.replace(system.started_at(model, q, shape), simulation=settings))
    _, places, _ = table_columns.States(model, run.columns)(run.rows[-1:])
    return np.asarray(places[0] - q)


@pytest.mark.parametrize("name", RESTING)
def test_a_small_push_moves_as_its_mode_says(name: str) -> None:
    """The lowest and the highest mode of each: pushed with v = u, half a period later q is back, to six digits of w."""
    found = modes(name, "equilibrium")
    assert found.about == "equilibrium"
    numbers = np.flatnonzero(found.eigenvalues)
    order = numbers[np.argsort(np.abs(found.eigenvalues[numbers]))]
    size = max(map(abs, found.at.values())) or 1.0
    # Of large ones the lowest alone: a run of each costs seconds.
    ends = (0,) if len(found.coordinates) > 60 else (0, -1)
    for k in {int(order[end]) for end in ends}:
        s = found.eigenvalues[k]
        j = k if found.frequencies is None else int(np.argmin(np.abs(found.frequencies - abs(s.imag))))
        shape = found.shapes[j]
        # The real part of shape exp(s t) moves as a mode does: q' = Re(s u exp(s t)).
        if np.abs(shape.imag).max() == 0 and s.real == 0:
            u, w = shape.real, abs(s.imag)
            t = np.pi / w
            end = pushed(name, found, PUSH * size * w * u, t) / (PUSH * size)
            # sin(w t) at t = pi/w: an error of w by one part moves it by pi parts.
            assert np.abs(end).max() <= np.pi * 1e-6
        elif s.imag == 0:
            u, t = shape.real, 1 / abs(s.real)
            end = pushed(name, found, PUSH * size * abs(s.real) * u, t) / (PUSH * size)
            # Where -s has the same shape, as without damping, q = u sinh(s t).
            if has_opposite(found, s):
                np.testing.assert_allclose(end, np.sinh(1.0) * u, atol=1e-6)


@pytest.mark.parametrize("v", [3.0, 5.0])
def test_a_pushed_bicycle_moves_as_the_sum_of_its_modes(v: float) -> None:
    """Capsize, castering and weave together: complex, damped and growing, q(t) = sum c_j u_j exp(s_j t)."""
    found = modes("bicycle", "equilibrium", v=v)
    n, s, U = len(found.coordinates), found.eigenvalues, found.shapes.T
    assert np.abs(s.imag).max() > 1
    push = PUSH * np.linspace(1.0, -0.4, n)
    c = np.linalg.lstsq(np.vstack([U, U * s]), np.concatenate([0 * push, push]), rcond=None)[0]
    for t in (0.4, 1.3):
        wanted = (U @ (c * np.exp(s * t))).real
        end = pushed("bicycle", found, push, t, v=v)
        np.testing.assert_allclose(end, wanted, atol=1e-6 * np.abs(wanted).max())


def test_a_damped_swing_dies_away_as_its_mode_says() -> None:
    """A complex pair: with a push of the real part, q(t) = Re(c u exp(s t)), to six digits of both parts of s."""
    model = lagcli.loads("""
lagcli: 1
coordinates: {x: {}, y: {}}
lagrangian: (rate(x)**2 + 2*rate(y)**2)/2 - 5*x**2 - 3*(1 - cos(y - x))
forces: {drag: {to: x, force: -0.3*rate(x)}}
""")
    found = lagcli.modes(model)
    s, U = found.eigenvalues, found.shapes.T
    assert (s.real < 0).all()
    assert (s.imag != 0).all()
    push = PUSH * np.array([1.0, -0.4])
    c = np.linalg.lstsq(np.vstack([U, U * s]), np.concatenate([0 * push, push]), rcond=None)[0]
    for t in (0.7, 6.1):
        wanted = (U @ (c * np.exp(s * t))).real
        end = (away(model, found, push, t) - away(model, found, -push, t)) / 2
        np.testing.assert_allclose(end, wanted, atol=1e-6 * np.abs(wanted).max())


def has_opposite(found: lagcli.Modes, s: complex) -> bool:
    """True if the eigenvalue -s has the same shape, as where nothing turns or is damped."""
    return bool(np.abs(found.eigenvalues + s).min() <= 1e-9 * abs(s))


def test_carbon_dioxide() -> None:
    found = modes("co2-vibrations")
    wave, ratio = 2 * np.pi * 0.0299792458, np.sqrt(1 + 2 * 15.999 / 12.011)
    assert not found.frequencies[:5].any()
    wanted = [667 * wave, 667 * wave, 1333 * wave, 1333 * wave * ratio]
    np.testing.assert_allclose(found.frequencies[5:], wanted, rtol=1e-11)


def test_water_has_the_three_frequencies_of_landau_and_lifshitz() -> None:
    found = modes("water-vibrations", "equilibrium")
    m_H, m_O, mdyn, half = 1.008, 15.9994, 6.02214076e4, np.deg2rad(52.26)
    k1, k2, mu = 7.76 * mdyn, 0.69 * mdyn, 2 * m_H + m_O
    broken = k1 / m_H * (1 + 2 * m_H / m_O * np.sin(half) ** 2)
    # w^4 - w^2 p + q = 0 of the two that keep the mirror.
    p = k1 / m_H * (1 + 2 * m_H / m_O * np.cos(half) ** 2) + 2 * k2 / m_H * (
        1 + 2 * m_H / m_O * np.sin(half) ** 2
    )
    q = 2 * mu * k1 * k2 / (m_O * m_H**2)
    wanted = np.sqrt(np.sort([broken, *np.roots([1, -p, q]).real]))
    assert not found.frequencies[:6].any()
    np.testing.assert_allclose(found.frequencies[6:], wanted, rtol=1e-10)
    # Measured: 1595, 3657 and 3756 per cm.
    np.testing.assert_allclose(wanted / (2 * np.pi * 0.0299792458), [1595, 3657, 3756], rtol=0.015)


@pytest.mark.parametrize(("part", "stable"), [(0.999, False), (1.001, None)])
def test_a_thin_disk_stays_up_from_its_critical_spin_on(part: float, stable: bool | None) -> None:
    found = modes("rolling-disk-upright", W=part * np.sqrt(9.81 / 1.2))
    assert found.about == "steady"
    assert found.stable is stable
    # (A + m r^2) s^2 = m g r (1 - part^2) with A = m r^2/4.
    square = 9.81 / (1.25 * 0.4) * (1 - part**2)
    largest = found.eigenvalues[np.argmax(np.abs(found.eigenvalues))]
    assert abs(largest) == pytest.approx(abs(square) ** 0.5, rel=1e-9)
    assert np.count_nonzero(found.eigenvalues) == 2


def test_the_bicycle_has_the_eigenvalues_of_its_benchmark() -> None:
    """Table 2 of Meijaard et al. (2007), v = 5 m/s, to twelve digits; matrices with fourteen."""
    found = modes("bicycle")
    published = [
        -14.0783896927982, -0.322866429004087,
        complex(-0.775341882195845, 4.46486771378823), complex(-0.775341882195845, -4.46486771378823),
    ]  # fmt: skip
    np.testing.assert_allclose(found.eigenvalues, published, rtol=1e-12)
    assert found.stable is True


@pytest.mark.parametrize(
    ("v", "stable"), [(4.292382, False), (4.292383, True), (6.024262, True), (6.024263, False)]
)
def test_the_bicycle_stays_up_between_its_weave_and_its_capsize_speed(v: float, stable: bool) -> None:
    assert modes("bicycle", v=v).stable is stable
