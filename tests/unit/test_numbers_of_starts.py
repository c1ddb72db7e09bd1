"""The numbers of a start, of contacts at an instant and of runs that go apart: on either side another answer."""

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from lagcli.compiled import row_block
from lagcli.compiled.contact_values import MotionNumbers
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import LocalRows
from lagcli.simulation import error_estimate
from lagcli.simulation.closed_contacts.contact_instant import ContactInstant, ContactParameters
from lagcli.simulation.error_estimate import Parting
from lagcli.start import assembly, conflict, initial, projection
from lagcli.start.initial import State

NOTHING = np.zeros(0)
EPS = float(np.finfo(float).eps)


def state(q=(0.0,), v=None):
    q = np.array(q, dtype=float)
    return State(0.0, q, np.zeros(q.size) if v is None else np.array(v, dtype=float), NOTHING)


def search_of(n=1, **more):
    """A search for a configuration of n coordinates of size one, none of which is fixed."""
    given = {"state": state(np.zeros(n)), "fixed": np.zeros(n, dtype=bool), "touched": lambda rows: None}
    given |= {"system": SimpleNamespace(holonomic_count=1), "size": lambda q, touched: 1.0}
    given |= {"full_metric": SimpleNamespace(length=lambda q: float(np.linalg.norm(q)))}
    return SimpleNamespace(**{**given, **more})


# The nearest configuration


@pytest.mark.parametrize(
    ("n", "part", "curvature", "is_nearest"),
    [
        (1, 3e-4, 0.7, True),
        (1, 3e-3, 0.7, False),
        (1, 3e-4, 0.3, False),
        (401, 3e-7, 0.3, True),
        (401, 3e-6, 0.7, False),
    ],
)
def test_a_start_that_is_near_and_little_curved_has_one_nearest_point(
    n, part, curvature, is_nearest, monkeypatch
):
    monkeypatch.setattr(assembly, "_curvature", lambda *_: curvature)
    assert assembly._is_clearly_nearest(search_of(n), np.full(n, part)) is is_nearest


# What a start may be off


def test_twenty_rows_are_named_one_by_one():
    system = SimpleNamespace(multiplier_rows=[SimpleNamespace(name=f"r{k}") for k in range(30)])
    assert initial.names_of(system, list(range(20))).count("`r") == 20
    assert initial.names_of(system, list(range(23))).endswith("`r19` and 3 more")


# Rows that contradict each other


@pytest.mark.parametrize(("apart", "rows"), [(1e-6, []), (5e-6, [0, 150])])
def test_many_rows_are_apart_by_six_digits(apart, rows):
    B = ca.DM(151, 151)
    for k in range(151):
        B[k, k % 150] = 1.0
    b = np.ones(151)
    b[150] += apart
    assert conflict.least(LocalRows(B), b) == rows


def test_rows_that_depend_on_each_other_are_compared_again_at_three_times(monkeypatch):
    times = []
    monkeypatch.setattr(row_block, "depends_on_time", lambda system: True)
    monkeypatch.setattr(
        conflict, "_parting", lambda system, numeric, here, later: times.append(later.t - here.t)
    )
    model = SimpleNamespace(simulation=SimpleNamespace(duration=10.0))
    conflict.require_lasting(SimpleNamespace(model=model), None, state())
    assert times == pytest.approx([0.01, 0.1, 1.0])


# Points of the surface beside a start


@pytest.mark.parametrize(("depends", "later"), [(True, 0.1), (False, 0.0)])
def test_points_move_on_by_a_hundredth_of_the_duration(depends, later, monkeypatch):
    monkeypatch.setattr(row_block, "depends_on_time", lambda system: depends)
    model = SimpleNamespace(simulation=SimpleNamespace(duration=10.0))
    assert initial.later(SimpleNamespace(model=model)) == pytest.approx(later)


def test_four_points_are_reached_by_walks_of_three_steps(monkeypatch):
    steps = []
    monkeypatch.setattr(
        projection,
        "_tangent_step",
        lambda numeric, here, rows, step, random: steps.append(step) or here,
    )
    assert len(projection.along(None, state(), [])) == 1 + 4
    assert steps == [0.2] * 12


@pytest.mark.parametrize(
    ("here", "edge", "is_flat"),
    [(3e-10, 0.0, True), (3e-9, 0.0, False), (3e-10, 3e-3, True), (3e-10, 3e-2, False)],
)
def test_a_gradient_vanishes_beside_what_it_is_a_hundredth_aside(here, edge, is_flat, monkeypatch):
    direction = projection.decompositions.generic_direction(1, projection.SEED)
    monkeypatch.setattr(projection.initial, "metric_at", lambda *_: Metric.unit(1))

    def rows(t, q, v, p):
        off = abs(float((q[0] - 1.0) / direction[0]))
        return ca.DM([[1.0 if off > edge else here]]), None

    found = projection.rows(SimpleNamespace(rows=rows), state([1.0]))
    assert bool(np.array(found.unit).any()) is not is_flat


# Contacts at an instant


def instant(speed=1.0, **more):
    """One contact at an instant: of a motion of size one and this speed, with units and accelerations of one."""
    found = ContactInstant.__new__(ContactInstant)
    values = SimpleNamespace(
        count=1, row=np.zeros(1, dtype=int), column=np.zeros(1, dtype=int), has_independent_rows=True
    )
    motion = MotionNumbers(acceleration=1.0, forces_blurred=0.0, size=1.0, speed=speed)
    given = {"state": state(), "_motion": motion, "units": np.ones(1), "size": 1.0}
    given |= {
        "values": values,
        "_entries": np.ones(1),
        "g": np.zeros(1),
        "touching_gap": np.ones(1),
        "slow": np.ones(1),
    }
    given |= {"speeds": np.zeros(1), "pull": np.zeros(1), "_few": {}}
    given |= {"_blurred": np.zeros(1), "chosen": ContactParameters(rtol=1e-9)}
    found.__dict__.update({**given, **more})
    return found


@pytest.mark.parametrize(
    ("speed", "gap", "parts"), [(300.0, 0.0, False), (3000.0, 0.0, True), (0.0, 3.0, False), (0.0, 5.0, True)]
)
def test_contacts_that_are_nearly_closed_part_clearly(speed, gap, parts):
    found = instant(speeds=np.array([speed]), g=np.array([gap]))
    assert found.parts(np.zeros(1)) is parts


@pytest.mark.parametrize(("size", "moves"), [(3e-11, False), (3e-10, True)])
def test_accelerations_and_speeds_of_ten_digits_less_than_the_forces_are_none(size, moves):
    assert (instant().reach(np.array([size]), 0.1) != (0.0, 0.0)) is moves
    moving = instant(state=state(v=[size]))
    assert (moving.reach(np.zeros(1), 0.1) != (0.0, 0.0)) is moves


def test_a_contact_creeps_below_eleven_digits():
    assert instant(speed=2.0).speed_roundoff == pytest.approx([2e-11], rel=1e-6, abs=0.0)


def test_a_force_of_ten_digits_less_is_none(monkeypatch):
    monkeypatch.setattr(ContactInstant, "squares", lambda here, contacts: np.ones(1))
    monkeypatch.setattr(ContactInstant, "few", lambda here, contacts: None)
    contact = np.array([0])
    pressed = instant(pull=np.array([3.0])).least_forces(contact, np.zeros(1))
    assert pressed == pytest.approx([3e-10], rel=1e-6, abs=0.0)
    creeping = instant(speed=2.0).least_forces(contact, np.zeros(1))
    assert creeping == pytest.approx([4e-22], rel=1e-6, abs=0.0)


@pytest.mark.parametrize(("count", "are_few"), [(4, True), (5, False)])
def test_four_contacts_are_few(count, are_few):
    contacts = np.arange(count)
    found = instant(_few={tuple(range(count)): "few"}).few(contacts)
    assert (found == "few") is are_few


# Runs that go apart


def apart(before, now, rtol=0.0):
    """Where the distance of two runs grows from one row to the next."""
    parting = Parting(1, rtol)
    gaps_of_kinds = np.array([[before] * 4, [now] * 4])
    parting.take(np.array([1.0, 2.0]), gaps_of_kinds, np.ones((2, 4)))
    return parting.found


def test_runs_go_apart_within_a_hundredth_of_the_rows():
    assert error_estimate.window(1000) == 10


@pytest.mark.parametrize(
    ("before", "now", "rtol", "is_found"),
    [
        (1e-10, 3e-6, 0.0, False),
        (1e-10, 3e-5, 0.0, True),
        (0.0, 3e-8, 0.0, False),
        (0.0, 3e-7, 0.0, True),
        (0.0, 3e-7, 1e-9, False),
        (0.0, 3e-6, 1e-9, True),
    ],
)
def test_runs_go_apart_where_their_distance_grows_too_fast(before, now, rtol, is_found):
    assert (apart(before, now, rtol) == (1.0, 2.0)) is is_found
