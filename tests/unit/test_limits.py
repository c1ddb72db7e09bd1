"""Limits of searches: reckoned from operations where nobody gives one, of the processor where somebody does."""

import itertools
import math
import pickle
import time
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
import sympy

import lagcli
from lagcli import memory, progress
from lagcli.analysis.holonomy import local_system
from lagcli.analysis.numeric_flag import bracket_values
from lagcli.api import check as checking
from lagcli.compiled import lie_brackets, paths
from lagcli.derivation import derivation
from lagcli.equations import system
from lagcli.model import settings
from lagcli.pfaffian.exact import time_limit

pytestmark = pytest.mark.numeric

KNIFE = """lagcli: 1
coordinates: {x: {value: 0.1}, y: {value: 0.2}, p: {value: 0.3}, w: {value: 0.4}}
lagrangian: rate(x)**2/2 + rate(y)**2/2 + rate(p)**2/2 + rate(w)**2/2
differential:
  edge: d(y)*cos(p) - d(x)*sin(p) = 0
  more: exp(w)*d(w) + x*exp(w)*d(y) + y*exp(w)*d(x) = 0
"""
# Powers of powers of numbers are left to numbers.
NUMBERS = KNIFE.replace("exp(w)*d(w) + x*exp(w)*d(y) + y*exp(w)*d(x)", "d(w) - (1.00001**200)**10*y*d(y)")


@pytest.fixture
def racing(monkeypatch):
    """A clock of the wall on which hours pass from one look to the next."""
    clock = itertools.count(0.0, 3600.0)
    monkeypatch.setattr(time, "monotonic", lambda: next(clock))
    memory.forget()


@pytest.mark.parametrize(("text", "freedoms"), [(KNIFE, (3, 2)), (NUMBERS, (3, 2))])
def test_no_clock_of_the_wall_ends_a_proof(text, freedoms, racing):
    count = lagcli.dof(lagcli.loads(text))
    assert (count.configuration_dof, count.velocity_dof, count.reason) == (*freedoms, "")


def test_nor_the_writing_of_equations_or_the_search_for_a_loop(racing):
    model = lagcli.loads(KNIFE)
    assert derivation.derive(system.build(model), derivation.Options()).text()
    assert checking.witness(model, "edge", assemble=False, limit=settings.LIMIT) is not None


def test_a_limit_that_somebody_gives_is_of_the_processor(monkeypatch):
    clock = [100.0]
    monkeypatch.setattr(progress, "time", SimpleNamespace(process_time=lambda: clock[0]))
    deadline = progress.after(5)
    progress.reckon(1000.0)
    assert progress.left(deadline) == 5.0
    assert progress.left(progress.soon(deadline, 0.8)) == pytest.approx(4.0)
    clock[0] += 6.0
    assert progress.left(deadline) == -1.0
    with progress.ends_after(2.0):
        progress.require_time()
        clock[0] += 3.0
        with pytest.raises(progress.OverTime):
            progress.require_time()


def test_a_limit_that_nobody_gives_passes_by_work_alone(monkeypatch):
    clock = [100.0]
    monkeypatch.setattr(progress, "time", SimpleNamespace(process_time=lambda: clock[0]))
    deadline = progress.after(settings.LIMIT)
    clock[0] += 1e6
    assert progress.left(deadline) == pytest.approx(20.0)
    progress.reckon(8.0)
    assert progress.left(deadline) == pytest.approx(12.0)
    assert isinstance(progress.soon(deadline, 0.5), progress.Counted)
    assert progress.left(progress.soon(deadline, 0.5)) == pytest.approx(6.0)
    assert isinstance(pickle.loads(pickle.dumps(settings.LIMIT)), progress.Counted)


def test_the_words_of_a_limit_say_of_which_kind_it_is():
    assert progress.told(5.0) == "5 s of processor time"
    assert progress.told(settings.LIMIT) == "20 s of processor time, reckoned from operations"


def test_the_same_work_is_reckoned_alike(monkeypatch):
    """Of numbers; what SymPy does depends on what it remembers."""

    def reckoned():
        memory.forget()
        spent = []
        monkeypatch.setattr(progress, "reckon", spent.append)
        lagcli.dof(lagcli.loads(NUMBERS))
        return spent

    first = reckoned()
    assert sum(first) > 0
    assert reckoned() == first


def test_a_search_that_is_over_leaves_its_rows_undecided():
    memory.forget()
    found = lagcli.dof(lagcli.loads(NUMBERS), limit=progress.Counted(1e-6))
    assert found.configuration_dof is None
    assert "limit" in found.reason or "time" in found.reason


def test_work_is_reckoned_by_its_kind(monkeypatch):
    before, deadline, x = time_limit.operations(), progress.after(settings.LIMIT), sympy.Symbol("x")
    for n in range(1000):
        sympy.sin(x + n)
    took, done = 20.0 - progress.left(deadline), time_limit.operations() - before
    assert took == pytest.approx(2.5e-5 * done, rel=0.01)

    spent = []
    monkeypatch.setattr(progress, "reckon", spent.append)
    forms = SimpleNamespace(
        wait=lambda: None,
        scale=1.0,
        _entries=[np.zeros(8)],
        _forms=lambda Z: np.zeros((len(Z), 2, 4)),
    )
    local_system.LocalPart.forms(forms, np.zeros((50, 4)))
    brackets = SimpleNamespace(_deadline=math.inf, _length=600, _sample=lambda shape: None)
    span = SimpleNamespace(rank=0, add=lambda sample: False)
    bracket_values.BracketValues.extend(brackets, span, (lie_brackets.LEAF, lie_brackets.LEAF), 1)
    z, u = ca.SX.sym("z", 2), ca.SX.sym("u", 1)
    field = ca.Function("field", [z, u], [ca.sin(z) * u])
    paths.PathSteps(field, paths.ROUGH).rate(np.ones((64, 2)), np.ones((64, 1)))
    assert spent == pytest.approx([1e-4 + 1e-6 * 50 * 8, 1e-6 * 600, 1e-8 * 64 * field.n_instructions()])
