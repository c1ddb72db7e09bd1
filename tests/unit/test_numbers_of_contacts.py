"""The numbers of contacts at an instant and along a step: on either side of each another answer."""

import math
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from lagcli import doubles
from lagcli.contact import (
    complementarity,
    impact_law,
    zero_bounds,
    zero_search,
)
from lagcli.contact.complementarity import ContradictoryRows
from lagcli.contact.impact_law import ContactBlock, FewContacts, Response
from lagcli.contact.zero_search import first_crossing
from lagcli.linear.metric import Metric
from lagcli.simulation.closed_contacts import contact_change, impact_series
from lagcli.simulation.events import run_contacts

EPS = doubles.EPS

# The first crossing along a step


def one(g, slope):
    """Values and slopes of one function."""
    return lambda x: (np.array([g(x)]), np.array([slope(x)]))


def test_the_misfit_of_a_piece_is_four_times_what_it_shows():
    assert zero_bounds.misfit((0.0, 0.0, 0.0, 0.0), 0.5, (0.25, 0.0), 0.0) == 4 * 0.25


@pytest.mark.parametrize(("misfit", "is_reported"), [(0.15, True), (0.3, False)])
def test_a_cubic_is_trusted_to_a_tenth_of_its_range(misfit, is_reported):
    assert zero_bounds.turns_once((1.0, 1 / 3, -1 / 3, -1.0), misfit, True) is is_reported


def piece(begin, slope, end, end_slope):
    ends = zero_search._Sample(0.0, begin, slope), zero_search._Sample(1.0, end, end_slope)
    return zero_search._Piece(*ends, 0.0)


def test_the_misfit_of_a_piece_is_half_of_its_bend_or_more():
    assert piece(0.0, 0.0, 1.0, 0.0).with_least_misfit().misfit == 0.5


def test_a_threefold_root_of_a_cubic_is_found_in_sixty_steps():
    # (0.3 - u)**3, of which each step of Newton's leaves two thirds of the distance.
    assert zero_bounds.fall((0.027, -0.063, 0.147, -0.343)) == pytest.approx(0.3, abs=1e-4)


def test_a_cut_keeps_a_tenth_from_the_ends_of_its_piece():
    # The lowest point is at 0.03.
    assert zero_search._cut_point(piece(0.0109, -0.06, 0.9509, 1.94), True) == pytest.approx(0.1)


def test_a_jump_over_zero_is_found_to_a_few_roundings():
    found = first_crossing(one(lambda x: 1.0 if x < 0.37 else -1.0, lambda x: 0.0), np.zeros(1))
    assert 0.0 <= found.x - 0.37 <= 8 * EPS


def test_a_search_that_never_ends_has_two_thousand_evaluations():
    found = first_crossing(one(lambda x: 1.0 if x in (0.0, 1.0) else math.nan, lambda x: 0.0), np.zeros(1))
    assert found.unresolved == (0,)
    assert 1990 < found.evaluations <= 2000


def test_a_root_is_found_to_rounding_where_slopes_say_nothing():
    search = zero_search._Search(one(lambda x: 0.3 - x, lambda x: 0.0), np.zeros(1), 1000)
    assert search.root(0, piece(0.3, 0.0, -0.7, 0.0)).x == pytest.approx(0.3, abs=1e-15)


def test_a_flat_root_is_found_to_rounding():
    found = first_crossing(one(lambda x: (0.3 - x) ** 3, lambda x: -3 * (0.3 - x) ** 2), np.zeros(1))
    assert found.x == pytest.approx(0.3, abs=1e-14)


@pytest.mark.parametrize(("count", "rows"), [(8, 8), (9, 1)])
def test_of_more_than_eight_functions_most_are_told_at_once(count, rows, monkeypatch):
    monkeypatch.setattr(zero_search._Search, "open_rows", lambda *_: np.array([0]))
    values = lambda x: (np.ones(count), np.zeros(count))  # noqa: E731
    search = zero_search._Search(values, np.zeros(count), 100)
    with np.errstate(divide="ignore", invalid="ignore"):
        assert len(search.candidates(search.sample(0.4), search.sample(1.0))) == rows


# Contacts that are complementary


@pytest.mark.parametrize(("times", "is_allowed"), [(5, True), (50, False)])
def test_a_bound_may_be_eight_roundings_off(times, is_allowed):
    def solve():
        return complementarity.solve(np.zeros((1, 1)), np.array([times * 1e-12]), 1e-12)

    if is_allowed:
        assert solve().multipliers.tolist() == [0.0]
    else:
        with pytest.raises(ContradictoryRows):
            solve()


@pytest.mark.parametrize(("angle", "is_solved"), [(6e-8, True), (6e-9, False)])
def test_no_vector_will_do_where_it_would_be_eight_digits_longer(angle, is_solved):
    A, h = np.array([[1.0, 0.0], [-1.0, angle]]), np.ones(2)
    if is_solved:
        assert complementarity.shortest(A, h).x[1] == pytest.approx(2 / angle, rel=1e-6)
    else:
        with pytest.raises(ContradictoryRows):
            complementarity.shortest(A, h)


# Loads that may be shared


def rows_at(sigma):
    """Two rows of which this is the smaller singular value."""
    half = sigma / math.sqrt(2)
    return np.array([[1.0, half], [1.0, -half]])


@pytest.mark.parametrize(("sigma", "is_unique"), [(1e-5, True), (1e-6, False)])
def test_loads_are_unique_where_rows_are_independent(sigma, is_unique):
    _, same = complementarity.shared(rows_at(sigma), np.ones(2))
    assert same.tolist() == [is_unique] * 2


# Impacts


def response(**more):
    given = {"x": np.ones(1), "of_equalities": np.zeros(0), "square": 1.0, "free": 1.0, "left": 0.0}
    return Response(**{**given, "terms": 1.0, **more})


@pytest.mark.parametrize(("square", "is_certain"), [(0.03, True), (0.003, False)])
def test_a_formula_serves_a_row_of_which_a_hundredth_is_left(square, is_certain):
    assert response(square=square).is_certain is is_certain


@pytest.mark.parametrize(("eigenvalue", "are_apart"), [(0.03, True), (0.003, False)])
def test_few_contacts_are_apart_from_a_hundredth(eigenvalue, are_apart):
    D = np.array([[1.0, 1.0 - eigenvalue], [1.0 - eigenvalue, 1.0]])
    assert FewContacts((response(), response()), D).are_apart is are_apart


@pytest.mark.parametrize(("left", "moves"), [(3e-8, False), (3e-7, True)])
def test_a_contact_of_which_equality_rows_leave_seven_digits_less_cannot_move(left, moves):
    block = ContactBlock(np.array([[1.0, 0.0], [1.0, left]]), 1)
    asked, rounding = np.array([0.0, 1.0]), np.zeros(1)
    if moves:
        assert block.push(asked, rounding)[0][1] == pytest.approx(left**-2, rel=1e-6)
    else:
        with pytest.raises(ContradictoryRows):
            block.push(asked, rounding)


def test_rows_of_an_impact_are_met_to_rounding():
    unit = np.array([[1.0, 0.0], [0.6, 0.8]])
    mu, _ = ContactBlock(unit, 0).push(unit @ (unit.T @ np.array([1.0, 2.0])), np.zeros(2))
    assert mu == pytest.approx([1.0, 2.0], rel=1e-14)


def test_speeds_after_an_impact_are_known_to_eight_roundings(monkeypatch):
    roundings = []

    def push(rows, c, d, rounding):
        roundings.append(rounding.tolist())
        return np.ones(1), np.zeros(0), np.ones(1), None

    monkeypatch.setattr(impact_law.TouchingRows, "push", push)
    nothing = ca.DM(0, 1), np.zeros(0)
    contact = ca.DM([[1.0]]), np.zeros(1), np.zeros(1)
    impact_law.impact(Metric.unit(1), np.array([-1.0]), nothing, contact)
    assert roundings == [[8 * EPS]]


# Series of impacts, and impacts that crowd


class Alternating:
    """Two contacts that are struck in turn until the last impact; the one that is struck parts so fast that its gap is
    `opened(number)` when the other one is struck, a time 1 later."""

    near = np.array([True, True])
    at_rest = np.array([False, False])
    slow, speed_roundoff, noise = np.full((3, 2), 1e-9)
    unresolved = np.ones(2)

    def __init__(self, opened, last):
        self.opened, self.last, self.count = opened, last, 0
        self.g, self.state = np.array([0.0, 0.5]), SimpleNamespace(v=np.zeros(2))
        self.speeds, self.gap = np.zeros(2), 0.5

    def moved(self, v):
        """The same at other speeds, which are the velocities."""
        self.speeds = v
        return self

    def impact(self, here, restitution, among):
        """The next impact."""
        struck = self.count % 2
        self.count += 1
        v = np.full(2, self.opened(self.count))
        if self.count < self.last:
            v[1 - struck] = -self.gap
        self.gap = self.opened(self.count)
        none = np.zeros(2)
        return contact_change.ImpactResult(
            v, v, none[:0], none, among, np.zeros(2, bool), none, (), np.zeros(2, bool), among
        )


def followed(monkeypatch, opened, last):
    """The number of impacts in a series."""
    contacts = Alternating(opened, last)
    monkeypatch.setattr(contact_change, "impact", contacts.impact)
    first = contacts.impact(contacts, None, np.array([True, False]))
    series = impact_series._Series(contacts, np.full(2, 0.5), first, np.array([False, True]))
    return len(series.followed())


def irregular(number):
    """Gaps that never return."""
    return 0.5 + 0.3 * math.sin(number * number)


@pytest.mark.parametrize(("opened", "count"), [(5.0, 40), (30.0, 5)])
def test_a_series_that_opens_tenfold_is_left_to_steps(monkeypatch, opened, count):
    assert followed(monkeypatch, lambda number: opened if number == 4 else irregular(number), 40) == count


def test_a_series_is_followed_for_five_thousand_impacts(monkeypatch):
    assert followed(monkeypatch, irregular, 1_000) == 1_000
    with pytest.raises(contact_change.ContactsUndecided, match=r"5001 impacts within 5e\+03"):
        followed(monkeypatch, irregular, 20_000)


def is_crowd(count, time, end, restitution=1.0):
    """True where impacts of one contact at the times of their numbers would have no end, once there are so many."""
    crowds = ()
    for number in range(count):
        crowds = run_contacts.counted(crowds, [0], [restitution], time(number))
        _, since, _, times = crowds[0]
    between = run_contacts.between(restitution)
    if since or len(times) < 4:
        return False
    return run_contacts.to_come(times, between, end) > run_contacts.MOST


def test_three_thousand_impacts_of_a_contact_may_crowd():
    assert not is_crowd(3_000, lambda number: number * 1e-9, 1.0)
    assert is_crowd(3_001, lambda number: number * 1e-9, 1.0)


@pytest.mark.parametrize(("pace", "is_told"), [(1 / 0.9e6, False), (1 / 1.1e6, True)])
def test_a_million_impacts_of_a_contact_may_be_to_come(pace, is_told):
    assert is_crowd(3_001, lambda number: number * pace, 1.0 + 3_000 * pace) == is_told
    # In a billiard they lie at equal angles.
    angle = math.pi * pace
    assert is_crowd(3_001, lambda number: -1 / math.tan((number + 0.5) * angle), 1e9) == is_told


def test_a_piston_that_closes_in_is_told_from_a_heavy_body_that_turns():
    for after in (0.3, 3.0, 30.0):
        assert is_crowd(3_001, lambda number, n=after: 2 - 1 / (number + n), 3.0)
        assert not is_crowd(3_001, lambda number, n=after: -1 / math.tan((number + n) * 1e-4), 1e9)


def test_impacts_that_thin_out_are_no_crowd():
    assert not is_crowd(3_001, lambda number: 1e-9 / (3_100 - number), 1.0)
    assert is_crowd(3_001, lambda number: -math.exp(-number / 1e3), 1e3)


def test_a_contact_that_comes_to_rest_after_many_rebounds_may_have_them():
    assert run_contacts.between(0.99) == 1_201
    # ln(1e-15)/ln(0.9999) impacts are left when a part of 1e-15 of the speed is.
    assert 3 * run_contacts.between(0.9999) > math.log(1e-15) / math.log(0.9999)
    assert run_contacts.between(1 - 1e-9) == 1_000


@pytest.mark.parametrize(("far", "is_next"), [(3e-10, True), (3e-9, False)])
def test_a_series_goes_on_as_it_did_where_its_directions_agree_to_nine_digits(far, is_next):
    part = impact_series._part(np.array([1.0, 0.5]), np.array([0.5, 0.25 + 0.5 * far]))
    assert (part == 0.5) if is_next else (part is None)


def test_a_gap_of_none_stays_the_part_of_itself_that_is_none():
    assert impact_series._part(np.zeros(2), np.zeros(2)) == 0.0
    assert impact_series._part(np.zeros(2), np.ones(2)) is None
