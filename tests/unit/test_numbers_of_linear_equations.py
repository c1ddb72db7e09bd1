"""The numbers that small deviations are judged by: two inputs beside each, with different answers."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from lagcli.linearization import floquet, linear_modes, reference, spectrum
from lagcli.linearization.linearized import Linear


@pytest.mark.parametrize(("beyond", "stable"), [(1e-7, False), (1e-9, None), (-1e-9, None), (-1e-7, True)])
def test_a_multiplier_leaves_the_unit_circle_by_more_than_the_rounding_of_a_period(
    beyond: float, stable: bool | None
) -> None:
    found = linear_modes.of_multipliers(np.array([1 + beyond, 0.5 + 0j]), 2.0, is_autonomous=False)
    assert found.stable is stable


@pytest.mark.parametrize(("speed", "rests"), [(1e-13, True), (1e-11, False)])
def test_what_leads_nowhere_in_the_time_of_the_run_is_at_rest(speed: float, rests: bool) -> None:
    assert reference.is_at_rest(np.array([0.2]), np.array([speed]), duration=1.0) == rests


@pytest.mark.parametrize(("left", "balanced"), [(3e-9, False), (3e-10, True)])
def test_forces_balance_where_a_part_of_rounding_is_left(left: float, balanced: bool) -> None:
    load, inertia = np.array([3.0, 1.0]), np.ones(2)
    linear = SimpleNamespace(load=load, residual=np.array([0.0, left * 3.0]), inertia=inertia)
    assert reference.is_balanced(cast(Linear, linear)) == balanced


@pytest.mark.parametrize(("size", "zeros"), [(3e-13, 0), (3e-14, 1)])
def test_a_singular_value_of_some_roundings_is_a_zero(size: float, zeros: int) -> None:
    assert spectrum.deflate(np.diag([1.0, size])).zeros == zeros


@pytest.mark.parametrize(("off", "returns"), [(1e-8, True), (1e-6, False)])
def test_a_motion_is_periodic_where_it_comes_back_to_seven_digits(off: float, returns: bool) -> None:
    def signature(t: float) -> np.ndarray:
        return np.array([np.sin(t), np.cos(t), off * t / np.pi])

    found = floquet.period(signature, 200.0)
    assert (found is not None) == returns
    if found is not None:
        assert found == pytest.approx(2 * np.pi, rel=1e-6)


@pytest.mark.parametrize(("part", "shown"), [(1e-8, True), (1e-10, False)])
def test_an_entry_of_a_shape_is_rounding_below_nine_digits(part: float, shown: bool) -> None:
    found = linear_modes._normalized(np.array([part, 2.0 + 0j]))
    assert (found[0] != 0) == shown


@pytest.mark.parametrize(("less", "first"), [(1e-8, 1), (1e-10, 0)])
def test_the_first_of_entries_as_large_as_the_largest_is_one(less: float, first: int) -> None:
    found = linear_modes._normalized(np.array([-1.0 + less, 1.0 + 0j]))
    assert found[first] == 1.0
