"""A slip of ours in the algebra is raised: it never passes for an answer that was not found."""

from __future__ import annotations

import importlib
import math
import sys
import types
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import sympy

import lagcli
from lagcli import progress
from lagcli.derivation.symbolic import tidy
from lagcli.pfaffian import first_integrals
from lagcli.pfaffian.exact import guarded, sampling, time_limit
from lagcli.pfaffian.forms.form import PfaffianBlock

HEAD = """\
lagcli: 1
coordinates:
  x: {value: 1}
  y: {value: 1}
  z: {value: 0.5}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(z)**2)/2
differential:
"""
MODELS = (
    '  row: "y*d(x) + 2*x*d(y) = 0"\n',
    '  r1: "d(x) - y*d(z) = 0"\n  r2: "d(y) - x*d(z) = 0"\n',
)
SAMPLE = (
    "analysis.classification.classifier",
    "derivation.symbolic.tidy",
    "derivation.writing.markup",
    "pfaffian.exact.normal_form",
    "pfaffian.exact.zero_test",
    "pfaffian.derived_flag",
    "pfaffian.combinations",
    "pfaffian.function_field",
    "pfaffian.integrating_factors",
    "pfaffian.potential",
    "pfaffian.tidy_integral",
)

x, y = sympy.symbols("x y", real=True)
_asked = iter(range(1_000_000))


def judge(rows: str) -> None:
    """Let a model be judged; its text differs every time, so that nothing is remembered."""
    lagcli.check(lagcli.loads(f"{HEAD}{rows}# {next(_asked)}\n"), limit=20)


def derive(rows: str) -> None:
    """Let the equations of a model be written, with nothing remembered."""
    tidy.tidy.cache_clear()
    assert lagcli.derive(lagcli.loads(HEAD + rows)).latex()


def functions(module: types.ModuleType) -> Iterator[tuple[Any, str, Any]]:
    """The functions and methods that are written in a module, with their owners."""
    owners = [c for c in vars(module).values() if isinstance(c, type) and c.__module__ == module.__name__]
    for owner in (module, *owners):
        for name, function in list(vars(owner).items()):
            if isinstance(function, types.FunctionType) and function.__code__.co_filename == module.__file__:
                yield owner, name, function


def slip(*_: object, **__: object) -> object:
    raise TypeError("a slip")


@pytest.mark.parametrize("name", SAMPLE)
def test_a_slip_in_any_function_is_raised(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module = importlib.import_module(f"lagcli.{name}")
    ask = derive if name.startswith("derivation.") else judge
    users: dict[tuple[Any, str], str] = {}  # functions, and a model that needs them

    def noted(place: tuple[Any, str], function: Any, rows: str) -> Any:
        def noting(*arguments: Any, **options: Any) -> Any:
            users.setdefault(place, rows)
            return function(*arguments, **options)

        return noting

    for rows in MODELS:
        with monkeypatch.context() as patch:
            for owner, attribute, function in functions(module):
                patch.setattr(owner, attribute, noted((owner, attribute), function, rows))
            ask(rows)
    assert users
    for (owner, attribute), rows in users.items():
        with monkeypatch.context() as patch:
            patch.setattr(owner, attribute, slip)
            with pytest.raises(TypeError, match="a slip"):
                ask(rows)


# What SymPy fails with is one exception, whatever it was.


@pytest.mark.parametrize(
    "failing",
    [
        lambda: guarded.factor_list(sympy.sin(y) ** 2 + 1 / sympy.sin(x) ** 2),  # PolynomialError
        lambda: guarded.subs(sympy.Min(x, 1), x, sympy.I),  # ValueError
        lambda: guarded.solve(sympy.exp(x) + sympy.sin(x) - x, x),  # NotImplementedError
    ],
)
def test_failures_of_sympy_are_one_exception(failing: Any) -> None:
    with pytest.raises(guarded.SympyFailure):
        failing()


def test_a_slip_in_a_wrong_call_or_a_function_that_sympy_calls_is_none_of_them() -> None:
    with pytest.raises(TypeError):
        guarded.factor()
    with pytest.raises(TypeError, match="a slip"):
        guarded.call(sympy.sin(x).replace, sympy.sin, slip)


def endless(depth: int) -> int:
    return endless(depth + 1)


def test_an_endless_recursion_of_ours_is_none_of_them() -> None:
    with pytest.raises(RecursionError):
        time_limit.run(progress.after(20), lambda: endless(0))


def test_an_expression_too_deep_for_sympy_is_one_of_them() -> None:
    deep = x
    for _ in range(sys.getrecursionlimit()):
        deep = sympy.sin(deep, evaluate=False)
    with pytest.raises(guarded.TooDeep):
        guarded.attempt(deep.diff, x)


def test_failures_hold_no_slip() -> None:
    for error in (TypeError, AttributeError, AssertionError, LookupError, ValueError, ArithmeticError):
        assert not issubclass(error, time_limit.NO_ANSWER)


# What surfaced when slips were no longer taken for failures.


def test_one_linear_equation_is_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    block = PfaffianBlock(("row",), (x, y), ((sympy.Integer(1), -3 * x),))
    monkeypatch.setattr(first_integrals, "_WAYS", [(first_integrals.linear_flow, 10_000)])
    search = first_integrals.IntegralSearch(block, progress.after(20))
    search.run()
    assert sympy.expand(search.found[0].integral - x * sympy.exp(-3 * y)) == 0


def test_a_number_that_is_not_real_has_no_sample() -> None:
    sample = sampling.Sample({x: np.ones(3)}, 3)
    for number in (sympy.sqrt(-2) + 1, sympy.zoo):
        with pytest.raises(sampling.NoSampleError):
            sample.of(number)
    assert math.isclose(sample.of(sympy.pi / 2 + 0 * x)[0], math.pi / 2)
