"""The lowest modes of models that are too large to be looked at whole."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.linearization import lowest
from lagcli.linearization.linearized import Linear

SPRINGS = """\
lagcli: 1
parameters: {N: 300, k: 3, m0: 2, s: 4}
particles:
  p[i]: {for: "i = 1..N", mass: m0, position: "[i, 0, 0]"}
forces:
  hook: {potential: "k/2*(norm(p[1]) - 1)**2"}
  spring[i]: {for: "i = 2..N", potential: "k/2*(distance(p[i-1], p[i]) - 1)**2"}
  side[i]: {for: "i = 1..N", potential: "s*(p[i].y**2 + 2*p[i].z**2)"}
"""
RODS = """\
lagcli: 1
parameters: {N: 250, l: 1/N, m0: 1, g: 9.81}
particles:
  p[i]: {for: "i = 1..N", mass: m0, position: "[0, 0, -i*l]"}
forces:
  weight: {to: p, force: [0, 0, -m*g]}
holonomic:
  hook: norm(p[1]) = l
  link[i]: {for: "i = 2..N", equation: "distance(p[i-1], p[i]) = l"}
"""


def springs(count: int) -> np.ndarray:
    """Of N = 300 masses in a row, held at one end."""
    return 2 * np.sqrt(3 / 2) * np.sin((2 * np.arange(1, count + 1) - 1) * np.pi / (4 * 300 + 2))


def test_a_long_row_of_springs() -> None:
    found = lagcli.modes(lagcli.loads(SPRINGS))
    assert found.frequencies is not None
    np.testing.assert_allclose(found.frequencies, springs(20), rtol=1e-9)
    assert found.count == 1800
    assert len(found.eigenvalues) == 40
    assert found.stable is True
    assert any("lowest 20" in note for note in found.notes)


def test_a_long_chain_of_rods_has_each_frequency_twice_and_none_is_missing() -> None:
    """For many links w = j_k/2 sqrt(g/L) with j_k the zeros of J_0, less a part of order 1/N."""
    found = lagcli.modes(lagcli.loads(RODS), lowest=6)
    assert found.frequencies is not None
    zeros = np.repeat([2.404825557695773, 5.520078110286311, 8.653727912911013], 2)
    np.testing.assert_allclose(found.frequencies, zeros / 2 * np.sqrt(9.81), rtol=5e-3)
    np.testing.assert_allclose(found.frequencies[::2], found.frequencies[1::2], rtol=1e-9)
    assert found.stable is True


def test_what_drives_away_is_found_far_from_zero() -> None:
    """Sideways each mass is driven away as exp(2 t): s = -4 makes m x'' = 8 x along y, 16 x along z."""
    found = lagcli.modes(lagcli.loads(SPRINGS, parameters={"s": -4}), lowest=4)
    assert found.stable is False
    assert found.growth == pytest.approx(np.sqrt(8), rel=1e-9)


def test_damping_is_constant() -> None:
    text = SPRINGS + "  drag: {to: p, force: -0.01*v}\n"
    found = lagcli.modes(lagcli.loads(text), lowest=3)
    root = np.sqrt(springs(3) ** 2 - 0.0025**2 + 0j)
    wanted = -0.0025 + 1j * root
    for z in wanted[root.imag == 0]:
        assert np.abs(found.eigenvalues - z).min() < 1e-9
    assert found.stable is None
    assert found.growth == max(found.eigenvalues.real)


def test_sparse_and_dense_algebra_agree_with_rows_that_are_dependent() -> None:
    from lagcli.api import cache, find_modes
    from lagcli.linearization import reference

    text = RODS.replace("N: 250", "N: 12") + "  again: 2*norm(p[1]) = 2*l\n"
    model = lagcli.loads(text)
    ready = cache.compiled(model)
    here, closed, _ = find_modes.start(ready, 1.0)
    found = reference.classified(
        find_modes._Linearizing(ready, 1.0, 20)._functions(closed), ready.numeric, here, 1.0
    )
    assert found is not None
    linear: Linear = found.linear
    some = lowest.modes(linear, 8)
    every = lagcli.modes(model).frequencies
    assert every is not None
    np.testing.assert_allclose(some.values.imag, every[:8], rtol=1e-9)
    assert some.count == 48
