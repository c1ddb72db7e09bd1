"""The numbers by which native code is made and left."""

import sys

import pytest

from lagcli.native import paying


def test_native_code_is_looked_for_where_its_library_is_loaded(monkeypatch):
    monkeypatch.setitem(sys.modules, paying.LIBRARY, object())
    assert [paying.pays(steps) for steps in (10, 19, 20)] == [False, False, True]


def test_native_code_pays_after_two_thousand_steps(monkeypatch):
    monkeypatch.delitem(sys.modules, paying.LIBRARY, raising=False)
    assert [paying.pays(steps) for steps in (20, 1999, 2000)] == [False, False, True]


def test_the_best_code_pays_after_two_hundred_thousand_steps():
    assert 100 * paying.PARAMETERS.soon == paying.PARAMETERS.best


@pytest.mark.parametrize(("size", "steps"), [(220_000, 2272), (6_400_000, 78), (10**10, 1)])
def test_a_loop_returns_within_some_hundredths_of_a_second(size, steps):
    assert paying.steps_at_once(size) == steps
