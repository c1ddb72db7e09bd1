"""Quantities that others publish and no column of one run holds: counts, eigenvalues, speeds at which they vanish."""

from __future__ import annotations

import functools
import pathlib
from collections.abc import Callable

import numpy as np
from scipy import optimize, special

import lagcli
from lagcli.model.model import Model

ROOT = pathlib.Path(__file__).parents[2]


def path(name: str) -> pathlib.Path:
    """The model of a case: one of the gallery, or beside the published numbers."""
    return ROOT / name if name.startswith("models/") else ROOT / "tests" / "reference" / "peers" / name


def _load(name: str, **parameters: float) -> Model:
    return lagcli.load(path(name), parameters)


def pendulum_error() -> float:
    """The largest distance from the motion by Jacobi's functions, of a pendulum that is let go from the level."""
    run = lagcli.simulate(_load("iftomm_a01.yaml"))
    quarter = special.ellipk(0.5)
    half_sine = np.sqrt(0.5) * special.ellipj(quarter - np.sqrt(9.81) * run.t, 0.5)[0]
    angle = 2 * np.arcsin(half_sine)  # from straight down
    return float(np.hypot(np.sin(angle) - run["P1.x"], -np.cos(angle) - run["P1.y"]).max())


def freedoms() -> float:
    return float(lagcli.dof(_load("models/bricard.yaml")).configuration_dof)


def redundant() -> float:
    return float(lagcli.dof(_load("models/bricard.yaml")).redundant)


@functools.cache
def _disc_squares() -> tuple[float, float]:
    """The squares of the frequency of lean at the rates 1 and 2 of rolling."""
    found = []
    for spin in (1.0, 2.0):
        modes = lagcli.modes(_load("sympy_rolling_disc.yaml", spin=spin))
        found.append(float(np.max(modes.eigenvalues.imag)) ** 2)
    return found[0], found[1]


def disc_square() -> float:
    return _disc_squares()[0]


def disc_critical() -> float:
    """The square of the frequency is linear in the square of the rate, and vanishes there with all eigenvalues."""
    first, second = _disc_squares()
    return 1.0 - first * 3.0 / (second - first)


def _bicycle(v: float) -> np.ndarray:
    return lagcli.modes(_load("models/bicycle.yaml", v=v)).eigenvalues


def _growth(v: float) -> float:
    return float(_bicycle(v).real.max())


def weave_speed() -> float:
    return float(optimize.brentq(_growth, 4.2, 4.4, xtol=1e-13))


def capsize_speed() -> float:
    return float(optimize.brentq(_growth, 6.0, 6.1, xtol=1e-13))


def weave() -> float:
    found = _bicycle(5.0)
    return float(found[found.imag > 1].real[0])


def capsize() -> float:
    found = _bicycle(5.0)
    return float(found[found.imag == 0].real.max())


QUANTITIES: dict[str, Callable[[], float]] = {
    made.__name__: made
    for made in (
        *(pendulum_error, freedoms, redundant, disc_square, disc_critical),
        *(weave_speed, capsize_speed, weave, capsize),
    )
}
