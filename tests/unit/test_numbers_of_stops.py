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
    """The failure of a run of one second where rows are so close to dependent ones."""
    monkeypatch.setattr(stop_diagnosis.singular_point, "closest", lambda *_: (0,))
    monkeypatch.setattr(stop_diagnosis.singular_point, "apart", lambda *_: 1e9)
    monkeypatch.setattr(causes_of_stops, "named", lambda *_: "`row`")
    monkeypatch.setattr(stop_diagnosis, "jump", lambda *_: "")
    monkeypatch.setattr(causes_of_stops.named_functions, "switching_contacts", lambda model: ())
    monkeypatch.setattr(stop_diagnosis, "time_scale", lambda *_: 1.0)
    monkeypatch.setattr(causes_of_stops.contact_change, "edges", lambda *_: ())
    simulation = SimpleNamespace(start=0.0, duration=1.0)
    system = SimpleNamespace(model=SimpleNamespace(simulation=simulation))
    enforced = SimpleNamespace(system=system, functions=SimpleNamespace(numeric=None))
    plain = SimpleNamespace(functions=SimpleNamespace(numeric=SimpleNamespace(force_switches=None)))
    enforced.plain = plain

    def found(rank_margin, is_alone, since=0.5):
        run = SimpleNamespace(
            bound=SimpleNamespace(enforced=enforced, h=[0.0], y=NOTHING, new=NOTHING),
            state_at=lambda t, y: State(t, y, y, y),
            timetable=SimpleNamespace(ahead=lambda *_: None),
            watch=SimpleNamespace(foreseen=SimpleNamespace(instant=0.5)),
            grid=SimpleNamespace(start=0.0, end=1.0),
            contacts=SimpleNamespace(last=0.5 - since),
            rank_margin=(rank_margin, is_alone),
            t=0.5,
            origin=0.0,
        )
        return causes_of_stops.no_step(run, math.nan, 0.0)

    return found


@pytest.mark.parametrize(("margin", "is_reason"), [(3e-3, True), (3e-2, False)])
def test_rows_that_are_dependent_to_a_hundredth_are_the_reason_of_a_stop(margin, is_reason, failure):
    assert (failure(margin, is_alone=True).code == run_stop.SINGULAR) is is_reason


@pytest.mark.parametrize(("since", "is_reported"), [(3e-3, True), (3e-2, False)])
def test_an_incident_within_a_hundredth_of_the_run_before_is_reported(since, is_reported, failure):
    assert ("too close behind the incident" in str(failure(1e-3, True, since))) is is_reported


@pytest.mark.parametrize(("margin", "is_reason"), [(3e-5, True), (3e-4, False)])
def test_inertias_that_differ_are_the_reason_of_a_stop_from_four_digits_on(margin, is_reason, failure):
    assert ("inertias that differ" in str(failure(margin, is_alone=False))) is is_reason


FAR = [1.0, 3.0, 9.0]


def standing(acceleration):
    """A run that stands where its acceleration is this function of the time."""
    numeric = SimpleNamespace(rhs=lambda t, y, p: np.array([0.0, acceleration(t), 0.0]))
    bound = SimpleNamespace(numeric=numeric, y=np.zeros(3), p=NOTHING)
    return SimpleNamespace(bound=bound, count=lambda evaluations: None)


@pytest.mark.parametrize(("order", "is_pole"), [(0.3, True), (0.2, False)])
def test_a_pole_is_of_the_order_of_a_quarter_at_least(order, is_pole):
    assert stop_diagnosis.is_pole(standing(lambda far: far**-order), FAR, 1.0) is is_pole


def test_accelerations_that_are_rounding_of_the_forces_are_no_pole():
    run = standing(lambda far: 1e-15 / far)
    assert not stop_diagnosis.is_pole(run, FAR, 1.0)
    assert stop_diagnosis.is_pole(run, FAR, 1e-15)
