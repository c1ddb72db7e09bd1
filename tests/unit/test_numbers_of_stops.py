"""The numbers that the reason of a stop is judged by: on either side another answer."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from lagcli.simulation.run_state import run_stop
from lagcli.simulation.stepping import causes_of_stops, stop_diagnosis
from lagcli.start.initial import State

NOTHING = np.zeros(0)


@pytest.fixture
def failure(monkeypatch):
    """The reason for which a run of one second fails where rows are so close to dependent ones."""
    monkeypatch.setattr(stop_diagnosis.singularity_step, "closest", lambda *_: (0,))
    monkeypatch.setattr(stop_diagnosis.singularity_step, "apart", lambda *_: 1e9)
    monkeypatch.setattr(causes_of_stops, "named", lambda *_: "`row`")
    monkeypatch.setattr(stop_diagnosis, "jump", lambda *_: "")
    monkeypatch.setattr(causes_of_stops.named_functions, "switching_contacts", lambda model: ())
    monkeypatch.setattr(stop_diagnosis, "time_scale", lambda *_: 1.0)
    monkeypatch.setattr(causes_of_stops.contact_change, "edges", lambda *_: ())
    simulation = SimpleNamespace(start=0.0, duration=1.0)
    system = SimpleNamespace(model=SimpleNamespace(simulation=simulation))
    enforced = SimpleNamespace(system=system, functions=SimpleNamespace(numeric=None))

    def found(rank_margin, is_alone, since=0.5):
        here = State(0.5, NOTHING, NOTHING, NOTHING)
        tried = stop_diagnosis.Rejection(
            enforced, math.nan, 0.0, here, here, rank_margin, is_alone, True, here.t - since
        )
        return causes_of_stops.reason(tried)

    return found


@pytest.mark.parametrize(("margin", "is_reason"), [(3e-3, True), (3e-2, False)])
def test_rows_that_are_dependent_to_a_hundredth_are_the_reason_of_a_stop(margin, is_reason, failure):
    assert (failure(margin, is_alone=True).code == run_stop.SINGULAR) is is_reason


@pytest.mark.parametrize(("since", "is_reported"), [(3e-3, True), (3e-2, False)])
def test_an_incident_just_before_is_reported(since, is_reported, failure):
    assert ("too close behind the incident" in failure(1e-3, True, since).sentence) is is_reported


@pytest.mark.parametrize(("margin", "is_reason"), [(3e-5, True), (3e-4, False)])
def test_inertias_that_differ_stop_a_run(margin, is_reason, failure):
    assert ("inertias that differ" in failure(margin, is_alone=False).sentence) is is_reason


@pytest.mark.parametrize(("order", "is_pole"), [(0.3, True), (0.2, False)])
def test_a_pole_is_of_the_order_of_a_quarter_at_least(order, is_pole):
    rates = [np.array([0.0, far**-order, 0.0]) for far in (1.0, 3.0, 9.0)]
    assert stop_diagnosis.is_pole(rates, 1.0) is is_pole


def test_accelerations_that_are_rounding_of_the_forces_are_no_pole():
    rates = [np.array([0.0, 1e-15 / far, 0.0]) for far in (1.0, 3.0, 9.0)]
    assert not stop_diagnosis.is_pole(rates, 1.0)
    assert stop_diagnosis.is_pole(rates, 1e-15)
