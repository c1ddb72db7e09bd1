"""What a run is spared: looks that a model does not need, and what an earlier run of it has found."""

import numpy as np
import pytest

import lagcli
from lagcli import memory
from lagcli.api import cache, prepare_run
from lagcli.equations import system
from lagcli.linear import metric_rows
from lagcli.model import dimension_facts
from lagcli.output.tables import incident_table
from lagcli.running import table_columns
from lagcli.simulation.scheme import step_tolerance
from lagcli.simulation.stepping import timetable
from lagcli.smoothness import time_functions
from lagcli.start import initial, lipschitz, projection

PENDULUM = """\
lagcli: 1
particles: {a: {mass: 1, position: [0, 0, -1], velocity: [1, 0, 0]}}
forces: {w: {to: a, force: [0, 0, -9.81*m]}}
holonomic: {rod: norm(a) = 1}
"""
DRIVEN = """\
lagcli: 1
parameters: {A: 1}
coordinates: {x: {value: 1}}
lagrangian: (rate(x)**2 - x**2)/2
forces: {push: {to: x, force: "A*cos(5*t) + sign(t - 0.3)"}}
"""


def refuse(*_):
    raise AssertionError("asked for")


def test_slopes_are_compared_only_where_one_grows(monkeypatch):
    monkeypatch.setattr(lipschitz, "projection", None)  # which has the widest of the distances
    model = lagcli.loads(PENDULUM)
    assert prepare_run.prepare(model, model.simulation).warnings == ()


@pytest.mark.parametrize("law", ["x**2", "x**2*rate(x)", "x ** -2", "sin(x)**3"])
def test_whole_powers_are_smooth(law, monkeypatch):
    monkeypatch.setattr(lipschitz, "_growing", refuse)
    text = DRIVEN.replace("sign(t - 0.3)", law)
    model = lagcli.loads(text)
    assert prepare_run.prepare(model, model.simulation).warnings == ()


@pytest.mark.parametrize("law", ["x**2.5", "x**2**0.5", "x**-1.5", "x**A"])
def test_powers_that_are_not_whole_are_looked_at(law, monkeypatch):
    asked = []
    monkeypatch.setattr(lipschitz, "_growing", lambda *_: asked.append(1))
    model = lagcli.loads(DRIVEN.replace("sign(t - 0.3)", law))
    run = prepare_run.prepare(model, model.simulation)
    assert not asked  # nor where nobody reads the warnings
    assert run.warnings == ()
    assert asked


def test_steps_do_not_ask_for_times_that_a_model_does_not_have(monkeypatch):
    monkeypatch.setattr(timetable.Timetable, "shortened", refuse)
    monkeypatch.setattr(timetable.Timetable, "switch", refuse)
    lagcli.simulate(lagcli.loads(PENDULUM), duration=1, samples=3)


def test_functions_of_time_are_found_once_for_the_same_values(monkeypatch):
    asked, searched = [], []
    functions, stations = time_functions.functions, timetable._stationary_times
    monkeypatch.setattr(time_functions, "functions", lambda model: asked.append(1) or functions(model))
    monkeypatch.setattr(timetable, "_stationary_times", lambda *of: searched.append(1) or stations(*of))
    first = lagcli.simulate(lagcli.loads(DRIVEN), duration=1, samples=11)
    once = len(searched)
    again = lagcli.simulate(lagcli.loads(DRIVEN), duration=1, samples=11)
    assert (first.rows == again.rows).all()
    assert (len(asked), len(searched)) == (1, once)
    other = lagcli.simulate(lagcli.loads(DRIVEN, {"A": 2}), duration=1, samples=11)
    assert len(asked) == 2
    memory.forget()
    anew = lagcli.simulate(lagcli.loads(DRIVEN, {"A": 2}), duration=1, samples=11)
    assert (other.rows == anew.rows).all()


def test_a_call_finds_nothing_that_an_earlier_one_has_found_of_the_model(monkeypatch):
    model = lagcli.loads(PENDULUM)
    first = lagcli.simulate(model, duration=0.1, samples=2)
    for owner, name in (
        (initial, "require_finite"),
        (step_tolerance, "resting_forces"),
        (system, "with_values"),
        (dimension_facts, "_find"),
        (incident_table, "columns"),
        (table_columns, "Floors"),
    ):
        monkeypatch.setattr(owner, name, refuse)
    again = lagcli.simulate(model, duration=0.1, samples=2)
    assert again.rows.tobytes() == first.rows.tobytes()
    assert again.stats.provenance == first.stats.provenance


def test_an_equal_model_that_was_changed_in_another_way_has_its_own_provenance():
    own, changed = lagcli.loads(PENDULUM), lagcli.loads(PENDULUM, {"a.velocity": "[1, 0, 0]"})
    assert own == changed
    changes = [lagcli.simulate(model, duration=0.1).stats.provenance.set for model in (own, changed, own)]
    assert changes == [{}, {"a.velocity": "[1, 0, 0]"}, {}]


def test_a_system_without_rows_has_none_to_choose(monkeypatch):
    monkeypatch.setattr(projection, "rows", refuse)
    lagcli.simulate(lagcli.loads(DRIVEN), duration=1, samples=3)


def test_a_few_rows_are_factored_once(monkeypatch):
    monkeypatch.setattr(metric_rows.MetricRows, "_solved", refuse)
    ready = cache.compiled(lagcli.loads(PENDULUM))
    rows = projection.rows(ready.numeric, initial.declared(ready.system))
    assert rows.are_independent
    value, vector = rows.weakest
    np.testing.assert_allclose([value, *np.abs(vector)], 1, rtol=1e-12)


def test_two_rows_that_are_the_same_are_dependent():
    text = PENDULUM.replace("norm(a) = 1", "norm(a) = 1, again: 2*norm(a) = 2")
    ready = cache.compiled(lagcli.loads(text))
    rows = projection.rows(ready.numeric, initial.declared(ready.system))
    assert not rows.are_independent
    np.testing.assert_allclose(np.abs(rows.weakest[1]), np.sqrt(0.5), rtol=1e-6)
