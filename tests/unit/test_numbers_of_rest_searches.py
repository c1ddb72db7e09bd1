"""The numbers of the searches for points of rest: two inputs beside each, with different answers.

The searches are given equations with known steps and ends, so that each number decides alone.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse.linalg
from mpmath import iv

from lagcli import doubles
from lagcli.statics import (
    algebraic_zeros,
    all_zeros,
    continuum,
    further_zeros,
    point_search,
    point_type,
    polynomial_equations,
    refine,
    rest_equations,
    singular_rows,
)
from lagcli.statics.continuum import FoundPoint
from lagcli.statics.point_search import PointSearch, SearchOptions
from lagcli.statics.point_type import PointType
from lagcli.statics.polynomial_equations import SpentError
from lagcli.statics.refine import EquilibriumPoint, NewtonEnd, NoEquilibrium
from lagcli.statics.rest_equations import Scales

NO_FORCE = NoEquilibrium(math.inf, np.zeros(1))


class Shrinking:
    """A residual of one unknown that becomes smaller by a factor whenever it is asked for, wherever that is."""

    def __init__(self, factor):
        self.factor, self.calls = factor, 0

    def __call__(self, x):
        size = self.factor**self.calls
        self.calls += 1
        return np.array([size]), np.ones((1, 1))


def scales(conditions=0, contacts=0, length=1.0):
    return Scales(1.0, length, np.ones(conditions), np.ones(contacts), np.ones(1), np.ones(1))


def fake_problem(n=1, C=0, K=0, **more):
    """A problem without laws: n coordinates, C rows, K contacts."""
    given = {"n": n, "C": C, "K": K, "t": 0.0, "times": (0.0,), "later": (), "begin": np.zeros(n)}
    given |= {"nothing": np.zeros(C + K), "evaluations": 0, "p": np.zeros(0)}
    given |= {"laws": SimpleNamespace(c=SimpleNamespace(numel=lambda: 0))}
    return SimpleNamespace(**{**given, **more})


def fake_equations(problem=None, acting=(), **more):
    given = {"problem": problem or fake_problem(), "scales": scales(), "acting": list(acting), "size": 1}
    return SimpleNamespace(**{**given, **more})


# Newton's steps and damped ones


def test_two_hundred_damped_steps_are_made_of_a_search():
    slow = Shrinking(0.99)
    refine._lowered(slow, np.zeros(1), slow(None), refine.PARAMETERS.most_damped, doubles.ROOT)
    assert slow.calls == 1 + 200


def test_damped_steps_end_where_newton_takes_over():
    halved = Shrinking(0.5)
    refine._lowered(halved, np.zeros(1), halved(None), 200, doubles.ROOT)
    assert halved.calls == 1 + 20  # 2**-20 is the root of what a value is known to


def test_a_slope_of_rounding_is_the_bottom_of_a_valley():
    for slope, steps in ((3e-15, 0), (3e-14, 1)):
        calls = []

        def valley(x, slope=slope, calls=calls):
            calls.append(x)
            return np.array([1.0, slope - x[0]]), np.array([[0.0], [-1.0]])

        refine._lowered(valley, np.zeros(1), valley(np.zeros(1)), 1, doubles.ROOT)
        assert len(calls) == 1 + steps


def test_the_least_damping_holds_back_what_is_seven_digits_weaker():
    J = np.array([[1.0, 1.0], [0.0, 3e-7]])
    step = refine._damped(J, J.T @ (J @ [-1.0, 1.0]), 0.0, np.ones(2))
    assert 0.2 < -step[1] < 0.5  # without damping 1


@pytest.mark.parametrize(("count", "is_sparse"), [(120, False), (121, True)])
def test_above_a_hundred_and_twenty_unknowns_algebra_is_sparse(count, is_sparse, monkeypatch):
    asked = []

    def splu(normal):
        asked.append(normal)
        return SimpleNamespace(solve=lambda slope: slope)

    monkeypatch.setattr(scipy.sparse.linalg, "splu", splu)
    refine._damped(np.eye(count), np.ones(count), 1e-3, np.ones(count))
    assert bool(asked) is is_sparse


# The way downhill


class Slope:
    """A height without a bottom, or with none lower than the start; `places` are those asked for."""

    def __init__(self, fall):
        self.fall, self.places = fall, []

    def value(self, q):
        self.places.append(float(q[0]))
        return -self.fall * (len(self.places) - 1)


def descent(monkeypatch, fall, step=1e-3, slope=1.0, begin=0.0):
    """The heights asked for on a way downhill whose every step is given, and its end."""
    height = Slope(fall)
    equations = fake_equations(fake_problem(value=height.value))
    monkeypatch.setattr(further_zeros, "_downhill", lambda *_: (np.array([step]), slope))
    return height.places, further_zeros.lowest(equations, np.array([begin]), 1.0)


def test_a_way_downhill_has_eighty_steps(monkeypatch):
    places, _ = descent(monkeypatch, 1.0)
    assert len(places) == 1 + 80


def test_a_step_that_does_not_go_down_is_halved_twelve_times(monkeypatch):
    places, _ = descent(monkeypatch, -1.0)
    assert len(places) == 1 + 12


def test_a_step_downhill_is_half_of_the_size_of_things(monkeypatch):
    places, _ = descent(monkeypatch, 1.0, step=100.0)
    assert places[1] == 0.5


@pytest.mark.parametrize(("slope", "steps"), [(3e-6, False), (3e-5, True)])
def test_where_forces_are_balanced_to_five_digits_is_the_bottom(slope, steps, monkeypatch):
    places, _ = descent(monkeypatch, 1.0, slope=slope)
    assert (len(places) > 1) is steps


@pytest.mark.parametrize(("fall", "is_taken"), [(3e-5, False), (3e-4, True)])
def test_a_step_goes_down_by_a_part_of_its_slope(fall, is_taken, monkeypatch):
    places, _ = descent(monkeypatch, fall)
    assert (places[2] > 1e-3) is is_taken  # else the first step is halved


@pytest.mark.parametrize(("begin", "is_found"), [(300.0, True), (3000.0, False)])
def test_what_goes_down_a_thousand_sizes_goes_down_for_ever(begin, is_found, monkeypatch):
    _, end = descent(monkeypatch, 1.0, slope=0.0, begin=begin)
    assert (end is not None) is is_found


def test_a_curvature_seven_digits_smaller_is_taken_for_more():
    values = SimpleNamespace(
        F=np.array([0.0, 1e-8]),
        B=np.zeros((0, 2)),
        G=np.zeros((0, 2)),
        K=np.diag([-1.0, -3e-8]),
        finite=True,
    )
    equations = fake_equations(
        fake_problem(2, at=lambda *_: values), multipliers=lambda q: [q], all_multipliers=lambda each: each
    )
    step, _ = further_zeros._downhill(equations, np.zeros(2), 1.0)
    assert abs(step[1]) == pytest.approx(0.1)


# Continua


@pytest.fixture
def along_x(monkeypatch):
    """One flat direction; each step along it is recorded and ends this part of the way."""
    steps = SimpleNamespace(lengths=[], part=1.0)

    def stepped(equations, x, change, off=0.3):
        steps.lengths.append(float(np.linalg.norm(change)))
        return x + steps.part * change

    monkeypatch.setattr(continuum, "directions", lambda *_: np.eye(1))
    monkeypatch.setattr(continuum, "stepped", stepped)
    monkeypatch.setattr(continuum.precise_zeros, "nearest", lambda *_: None)
    return steps


def test_a_continuum_is_told_by_a_step_of_a_hundredth(along_x):
    assert continuum.tangent(fake_equations(), np.zeros(1)).shape[1] == 1
    assert max(along_x.lengths) == 0.01


@pytest.mark.parametrize(("part", "dimension"), [(0.2, 0), (0.4, 1)])
def test_a_step_that_comes_back_has_not_gone_along_a_continuum(part, dimension, along_x):
    along_x.part = part
    assert continuum.tangent(fake_equations(), np.zeros(1)).shape[1] == dimension


@pytest.mark.parametrize(("away", "is_one"), [(15.5, True), (16.5, False)])
def test_a_walk_along_a_continuum_is_sixteen_sizes_long(away, is_one, along_x, monkeypatch):
    monkeypatch.setattr(continuum, "_is_straight", lambda *_: False)
    assert continuum.connected(fake_equations(), np.zeros(1), np.array([away]), 1) is is_one
    assert max(along_x.lengths) == pytest.approx(0.2)
    if not is_one:
        assert len(along_x.lengths) == 80


@pytest.mark.parametrize(("left", "is_one"), [(3e-7, True), (3e-6, False)])
def test_a_walk_has_arrived_where_a_millionth_is_left(left, is_one, monkeypatch):
    monkeypatch.setattr(continuum, "_is_straight", lambda *_: False)
    monkeypatch.setattr(continuum, "directions", lambda *_: np.eye(1))
    monkeypatch.setattr(continuum, "stepped", lambda *_: None)
    assert continuum.connected(fake_equations(), np.zeros(1), np.array([left]), 1) is is_one


def test_points_at_equal_distances_are_no_straight_continuum(along_x, monkeypatch):
    assert continuum._is_straight(fake_equations(), np.zeros(1), np.ones(1))
    assert len(along_x.lengths) == 8
    assert max(along_x.lengths) == 1.0
    for count in range(1, 11):

        def stepped(equations, x, change, count=count):
            return x + change if abs(math.sin(math.pi * count * change[0])) < 1e-3 else None

        monkeypatch.setattr(continuum, "stepped", stepped)
        assert not continuum._is_straight(fake_equations(), np.zeros(1), np.ones(1))


@pytest.mark.parametrize(("tilt", "without"), [(3e-8, True), (3e-7, False)])
def test_contacts_that_lean_by_rounding_leave_no_side(tilt, without):
    assert continuum._without_side(np.array([[1.0, 0.0], [-1.0, tilt]]))[0] is without


# Further zeros


class Line(SimpleNamespace):
    """F(x) = x - zero."""

    def __call__(self, x):
        self.calls = getattr(self, "calls", 0) + 1
        return x - self.zero, np.eye(1)


def line(zero):
    return Line(zero=zero, problem=fake_problem(), scales=scales())


def path(zero=25.0):
    equations = line(zero)
    return further_zeros._Path(equations, np.zeros(1), equations(np.zeros(1)))


@pytest.mark.parametrize(("off", "count"), [(3e-8, 0), (3e-7, 1)])
def test_a_start_that_is_a_zero_has_no_path(off, count):
    assert len(list(further_zeros.near_zeros(line(0.0), np.array([off])))) == count


@pytest.mark.parametrize(("zero", "count"), [(20.0, 1), (40.0, 0)])
def test_a_path_is_followed_for_thirty_sizes(zero, count):
    assert len(list(further_zeros.near_zeros(line(zero), np.zeros(1)))) == count


def test_steps_along_a_path_grow_up_to_a_third(monkeypatch):
    way, asked = path(), []
    monkeypatch.setattr(way, "_corrected", lambda z: asked.append(z) or z)
    list(way.followed(1.0))
    lengths = np.linalg.norm(np.diff(asked, axis=0), axis=1)
    assert np.linalg.norm(asked[0] - way._begin) == pytest.approx(0.05)
    assert lengths.max() == pytest.approx(0.3)


def test_a_path_has_a_hundred_and_sixty_steps(monkeypatch):
    way, asked = path(), []
    monkeypatch.setattr(way, "_corrected", lambda z: asked.append(z) or np.zeros(2))
    monkeypatch.setattr(way, "_tangent", lambda z: np.array([1.0, 0.0]))
    list(way.followed(1.0))
    assert len(asked) == 160


def test_a_step_is_corrected_four_times(monkeypatch):
    way, asked = path(), []
    monkeypatch.setattr(way, "_values", lambda z: asked.append(z) or (np.ones(1), np.ones((1, 2))))
    assert way._corrected(np.zeros(2)) is None
    assert len(asked) == 4 + 1


def test_a_path_that_asks_for_steps_of_a_hundred_thousandth_is_given_up(monkeypatch):
    way, asked = path(), []
    monkeypatch.setattr(way, "_corrected", lambda z: asked.append(z))
    list(way.followed(1.0))
    assert len(asked) == 8  # 0.05 / 3**8 is the first below 1e-5


@pytest.mark.parametrize(("cosine", "goes_on"), [(0.75, True), (0.65, False)])
def test_a_step_that_bends_much_is_made_shorter(cosine, goes_on, monkeypatch):
    way, asked = path(), []
    monkeypatch.setattr(way, "_corrected", lambda z: asked.append(z) or z)
    turn = iter([np.array([1.0, 0.0]), np.array([cosine, math.sqrt(1 - cosine**2)])])
    monkeypatch.setattr(way, "_tangent", lambda z: next(turn, None))
    list(way.followed(1.0))
    assert bool(np.linalg.norm(asked[1] - way._begin) > 0.05) is goes_on


@pytest.mark.parametrize(("distance", "factor"), [(3e-9, 1e16), (3e-8, 1 / 9e-16)])
def test_a_known_zero_is_not_divided_by_closer_than_eight_digits(distance, factor):
    equations = further_zeros.DeflatedEquations(line(1.0), [np.zeros(1)], [False])
    r, _ = equations(np.array([distance]))
    assert abs(r[0]) == pytest.approx(factor, rel=1e-6)


def test_the_latest_sixty_known_points_are_taken_out():
    for count in (60, 61):
        equations = further_zeros.DeflatedEquations(line(2.0), [np.zeros(1)] * count, [False])
        assert abs(equations(np.ones(1))[0][0]) == 2.0**60


# The refinement of a point


@pytest.mark.parametrize(
    ("step", "left", "is_point"),
    [(3e-6, 0.0, True), (3e-5, 0.0, False), (0.0, 3e-10, True), (0.0, 3e-9, False)],
)
def test_a_point_is_settled_and_balanced(step, left, is_point):
    values = SimpleNamespace(
        F=np.zeros(1), B=np.zeros((0, 1)), c=np.zeros(0), g=np.zeros(0), G=np.zeros((0, 1))
    )
    equations = fake_equations(
        fake_problem(at=lambda *_: values),
        split=lambda x: (x, [np.zeros(0)]),
        all_multipliers=lambda each: each,
        unbalanced=lambda x: left,
    )
    found = refine.settled(equations, np.zeros(1), step)
    assert isinstance(found, EquilibriumPoint) is is_point


@pytest.mark.parametrize(("gap", "touches"), [(3e-10, True), (3e-9, False)])
def test_a_contact_is_closed_to_nine_digits(gap, touches):
    problem = fake_problem(K=1, at=lambda *_: SimpleNamespace(g=np.array([gap])))
    point = EquilibriumPoint(np.zeros(1), np.zeros(1), (), 0.0)
    assert refine.touching(problem, point, scales(contacts=1)) == ((0,) if touches else ())


def test_twelve_sets_of_closed_contacts_are_tried_from_a_guess(monkeypatch):
    tried = []
    point = EquilibriumPoint(np.zeros(1), np.zeros(20), (), 0.0)
    monkeypatch.setattr(refine, "reached", lambda problem, place, closed, size: tried.append(closed) or point)
    monkeypatch.setattr(refine, "wrong_side", lambda *_: (set(), {len(tried)}))
    monkeypatch.setattr(refine, "_complementary", lambda problem, begin, size: (begin, ()))
    problem = fake_problem(K=20, at=lambda *_: SimpleNamespace(g=np.ones(20)))
    refine.pushed(problem, np.zeros(1), scales(contacts=20))
    assert len(tried) == 3 * 12


def test_starts_lie_beside_the_first_in_four_sizes(monkeypatch):
    places = []
    monkeypatch.setattr(rest_equations, "scales", lambda *_: scales())
    monkeypatch.setattr(
        refine, "reached", lambda problem, place, *_: places.append(place) or NoEquilibrium(1.0, place)
    )
    refine.nearest_equilibrium(fake_problem(900), np.zeros(900))
    away = np.linalg.norm(places, axis=1) / 30.0
    assert away == pytest.approx([0.0, 0.003, 0.03, 0.1, 0.3], rel=0.1)


# The search for all points


@pytest.fixture
def search_of(monkeypatch):
    """A search over a problem without laws."""
    monkeypatch.setattr(rest_equations, "scales", lambda problem, q: scales(contacts=problem.K))

    def made(n=1, K=0, C=0, has_potential=True, **more):
        options = SearchOptions(has_potential, True, (False,) * n, 1, 0)
        return PointSearch(fake_problem(n, C=C, K=K, **more), options)

    return made


def found_point(x, kind="minimum", closed=()):
    point = EquilibriumPoint(np.array([x]), np.zeros(1), closed, 0.0)
    return FoundPoint(point, PointType(kind, 0, True, 0, 1, kind != "degenerate"), 0, ())


@pytest.mark.parametrize(("kind", "limit"), [("minimum", 1e-6), ("degenerate", 3e-4)])
def test_points_that_are_one_are_kept_once(kind, limit, search_of):
    search = search_of()
    search.points = [found_point(0.0, kind)]
    of_flat = point_search.PARAMETERS.same_of_flat
    assert search._is_known(found_point(0.3 * limit).point, of_flat)
    assert not search._is_known(found_point(3 * limit).point, of_flat)


@pytest.mark.parametrize(("contacts", "is_cut"), [(6, False), (7, True)])
def test_sixty_four_sets_of_contacts_are_searched(contacts, is_cut, search_of):
    search = search_of(n=7, K=contacts)
    assert len(search._sets) == 64
    assert search.is_cut is is_cut


@pytest.mark.parametrize(("contacts", "searched"), [(2, 4), (3, 1)])
def test_four_sets_are_searched_from_each_start_and_of_more_one(contacts, searched, search_of, monkeypatch):
    search, asked = search_of(n=4, K=contacts), []
    search.starts = 1
    monkeypatch.setattr(refine, "pushed", lambda *_: NO_FORCE)
    monkeypatch.setattr(search, "_from", lambda begin, closed: asked.append(closed))
    search._start(np.zeros(4))
    assert len(asked) == searched


@pytest.mark.parametrize(("unknowns", "waits"), [(60, False), (61, True)])
def test_above_sixty_unknowns_the_starts_beside_wait(unknowns, waits, search_of, monkeypatch):
    search, asked = search_of(n=unknowns), []
    monkeypatch.setattr(search, "_nearest", lambda begin, asides: asked.append(asides) or NO_FORCE)
    monkeypatch.setattr(search, "_from", lambda *_: None)
    search._start(np.zeros(unknowns))
    assert (asked[0] == ()) is waits


def test_starts_are_drawn_beside_across_and_beyond(search_of):
    search = search_of(n=900)
    away = [np.linalg.norm(q) / 30 for q in search.others(4)]
    assert away == pytest.approx([0.0, 1.0, 2.5, 0.3], rel=0.1)


@pytest.mark.parametrize(("points", "is_cut"), [(399, False), (400, True)])
def test_a_search_ends_with_four_hundred_points(points, is_cut, search_of, monkeypatch):
    search = search_of()
    search.starts = 1
    monkeypatch.setattr(search, "_start", lambda begin: [])
    search.points = [found_point(0.0)] * points
    search.run(1)
    assert search.is_cut is is_cut


@pytest.mark.parametrize(("evaluations", "is_cut"), [(14_900, False), (15_100, True)])
def test_a_search_ends_with_its_budget(evaluations, is_cut, search_of, monkeypatch):
    search = search_of(evaluations=evaluations)  # each costs a thousand operations
    search.starts = 1
    monkeypatch.setattr(search, "_start", lambda begin: [])
    search.run(1)
    assert search.is_cut is is_cut


@pytest.mark.parametrize(("residual", "is_reported"), [(5e-16, True), (5e-15, False)])
def test_a_coordinate_that_rounding_moves_is_reported_as_zero(residual, is_reported, search_of, monkeypatch):
    tidy = EquilibriumPoint(np.zeros(1), np.zeros(0), (), residual)
    monkeypatch.setattr(refine, "begun", lambda *_: np.zeros(1))
    monkeypatch.setattr(refine, "settled", lambda *_: tidy)
    found = EquilibriumPoint(np.full(1, 1e-16), np.zeros(0), (), 0.0)
    assert (search_of()._tidied(None, found, 1e-15) is tidy) is is_reported


@pytest.fixture
def from_a_start(search_of, monkeypatch):
    """The ways out from one start: those of the homotopy, and the damped steps of each deflation."""

    def made(size=1, vain=0, is_new=True):
        asked = SimpleNamespace(paths=0, damped=[])
        search = search_of()
        search._vain = vain
        search.points = [found_point(0.0)]
        monkeypatch.setattr(refine, "reached", lambda *_: NO_FORCE)
        monkeypatch.setattr(refine, "begun", lambda *_: np.zeros(1))
        monkeypatch.setattr(refine, "settled", lambda *_: NO_FORCE)
        monkeypatch.setattr(further_zeros, "lowest", lambda *_: None)
        monkeypatch.setattr(refine, "refined", lambda *_: NewtonEnd(np.zeros(1), 0.0, 0.0))
        monkeypatch.setattr(
            refine, "solve", lambda r, x, damped: asked.damped.append(damped) or NewtonEnd(x, 0.0, 0.0)
        )
        monkeypatch.setattr(point_search, "RestEquations", lambda *_: Sized(size=size))
        monkeypatch.setattr(search, "take", lambda found: is_new)

        def along_path(equations, begin):
            asked.paths += 1

        monkeypatch.setattr(search, "_along_path", along_path)
        search._around(np.zeros(1), (), is_followed=True)
        return asked

    return made


class Sized(SimpleNamespace):
    def __call__(self, x):
        return x, x


def test_known_points_are_taken_out_twice_from_a_start(from_a_start):
    assert from_a_start().damped == [60, 60]


@pytest.mark.parametrize(("size", "paths"), [(60, 1), (61, 0)])
def test_above_sixty_unknowns_no_points_are_taken_out(size, paths, from_a_start):
    assert from_a_start(size=size).paths == paths


@pytest.mark.parametrize(("vain", "rounds"), [(11, 1), (12, 0)])
def test_twelve_rounds_in_vain_are_the_last(vain, rounds, from_a_start):
    assert len(from_a_start(vain=vain, is_new=False).damped) == rounds


def test_a_path_is_followed_from_eight_starts(search_of, monkeypatch):
    search, asked = search_of(), []
    search.starts = 1
    monkeypatch.setattr(search, "_start", lambda begin: [()])
    monkeypatch.setattr(search, "_around", lambda begin, closed, is_followed: asked.append(is_followed))
    search.run(100)
    assert asked == [True] * 8 + [False] * 92


def test_the_first_start_takes_a_quarter_of_the_budget(search_of, monkeypatch):
    search, allowed = search_of(), []
    monkeypatch.setattr(search, "_start", lambda begin: allowed.append(search._allowed) or [])
    search.run(2)
    assert allowed == pytest.approx([1.5e7 / 4, 1.5e7 / 2, 1.5e7])


# Places where gradients depend on each other


@pytest.fixture
def dependent_places(search_of, monkeypatch):
    """The places that searches with a given end find, and the damped steps of each."""

    def made(n=1, K=0, x=0.5, residual=0.0):
        asked = []
        values = SimpleNamespace(B=np.ones((1, n)), G=np.ones((K, n)), g=np.zeros(K), finite=True)
        search = search_of(n=n, C=1 - K, K=K, at=lambda *_: values)
        monkeypatch.setattr(singular_rows.DependentGradients, "bends", lambda *_: True)
        monkeypatch.setattr(singular_rows.DependentGradients, "__call__", lambda self, x: (np.zeros(1), None))

        def solve(equations, begin, damped):
            asked.append(damped)
            return NewtonEnd(np.full(n + 1, x), residual, 0.0)

        monkeypatch.setattr(refine, "solve", solve)
        return singular_rows.singular_points(search), asked

    return made


@pytest.mark.parametrize(("n", "searched"), [(12, True), (13, False)])
def test_places_of_dependent_gradients_are_sought_among_twelve_coordinates(n, searched, dependent_places):
    _, asked = dependent_places(n=n)
    assert bool(asked) is searched


def test_such_points_are_sought_from_twelve_starts_beside_the_first(dependent_places):
    _, asked = dependent_places()
    assert asked == [80] * 13


def test_such_points_are_sought_from_four_starts_where_contacts_close(dependent_places):
    _, asked = dependent_places(K=1)
    assert asked == [80] * 5


@pytest.mark.parametrize(("residual", "count"), [(3e-11, 1), (3e-10, 0)])
def test_such_a_point_has_no_residual(residual, count, dependent_places):
    found, _ = dependent_places(residual=residual)
    assert len(found) == count


@pytest.mark.parametrize(("x", "is_zero"), [(1e-4, True), (1e-3, False)])
def test_a_coordinate_of_such_a_point_is_zero_to_the_root_of_rounding(x, is_zero, dependent_places):
    found, _ = dependent_places(x=x)
    assert bool(found[0].q[0] == 0.0) is is_zero


@pytest.mark.parametrize(("count", "sentences"), [(4, 4), (5, 5), (6, 5)])
def test_a_note_names_four_such_points(count, sentences, search_of, monkeypatch):
    search = search_of(value=lambda q: 0.0)
    place = singular_rows.SingularPoint(np.ones(1), False)
    monkeypatch.setattr(singular_rows, "singular_points", lambda search: [place] * count)
    told = singular_rows.notes(search, ["x"], "f")
    assert len(told) == sentences
    assert (told[-1] == "there are more such points") is (count > 4)


# One unknown, by intervals


def shells_of(force, search):
    return all_zeros._pieces(force, search, False)


@pytest.mark.parametrize(("zero", "is_found"), [(3e5, True), (3e6, False)])
def test_all_zeros_of_one_unknown_lie_within_a_million_sizes(zero, is_found, search_of):
    found = shells_of(lambda x: (x - zero, iv.mpf(1)), search_of())
    assert bool(found.isolated) is is_found
    assert bool(found.undecided) is not is_found


def test_an_interval_of_a_turn_overlaps_itself(search_of):
    pieces = all_zeros._pieces(lambda x: (iv.mpf([-1, 1]), iv.mpf([-1, 1])), search_of(), True).undecided
    low, high = min(low for low, _ in pieces), max(high for _, high in pieces)
    assert 0 < high - low - 2 * math.pi < 1e-11


def test_intervals_have_twenty_digits(search_of, monkeypatch):
    digits = []

    def pieces(*_):
        digits.append(iv.dps)
        return all_zeros.LinePieces()

    monkeypatch.setattr(all_zeros, "_pieces", pieces)
    all_zeros.by_intervals(search_of(slope_program=lambda: None), False)
    assert digits == [20]


@pytest.mark.parametrize(("width", "is_known"), [(0.006, True), (0.0035, False)])
def test_four_thousand_intervals_are_looked_at(width, is_known, search_of):
    looks = []

    def force(x):
        looks.append(x)
        return iv.mpf([1, 2] if x.delta < width else [-1, 1]), iv.mpf([-1, 1])

    found = all_zeros._pieces(force, search_of(), True)
    assert (not found.undecided) is is_known
    assert 2000 < len(looks) <= 4000


def test_a_double_zero_is_enclosed_to_nine_digits(search_of):
    found = all_zeros._pieces(lambda x: ((x - 0.3) ** 2, 2 * (x - 0.3)), search_of(), True)
    (piece,) = all_zeros._merged(found.undecided)
    assert 3e-10 < piece[1] - piece[0] < 3e-9


@pytest.mark.parametrize(("count", "is_more"), [(4, False), (5, True)])
def test_four_undecided_pieces_are_named(count, is_more):
    told = all_zeros._undecided([(float(k), float(k)) for k in range(count)])
    assert told.count("near") == 4
    assert ("elsewhere" in told) is is_more


# All points by exact algebra


@pytest.mark.parametrize(
    ("n", "K", "is_counted"), [(24, 0, True), (25, 0, False), (1, 3, True), (1, 4, False)]
)
def test_points_of_twenty_four_unknowns_and_three_contacts_are_counted(
    n, K, is_counted, search_of, monkeypatch
):
    monkeypatch.setattr(all_zeros, "_of_set", lambda *_: ([], []))
    found = all_zeros.by_algebra(search_of(n=n, K=K))
    assert found.proved is is_counted
    if not is_counted:
        assert found.reason == "there are too many unknowns for exact algebra"


@pytest.mark.parametrize(("cost", "is_spent"), [(1_000_000, False), (4_000_000, True)])
def test_two_million_comparisons_of_monomials_are_made(cost, is_spent, search_of, monkeypatch):
    def equations(program, count, numbers, order, signs):
        if cost > order.left:
            raise SpentError
        return SimpleNamespace(used=(), ring=None, equations=(), denominators=())

    monkeypatch.setattr(polynomial_equations, "equations", equations)
    monkeypatch.setattr(algebraic_zeros, "zeros", lambda *_: [])
    found = all_zeros.by_algebra(search_of(exact_program=lambda closed: (None, 0)))
    assert (found.reason == "the budget of exact algebra is spent") is is_spent


# The kind of a point


def kind_of(K, lam=(), closed=(), force=1.0):
    """The type of a point with this gradient of the forces, of a problem that depends on t."""
    n, K = len(K), np.array(K, dtype=float)
    values = SimpleNamespace(B=np.zeros((0, n)), G=np.zeros((0, n)), K=K, F=np.zeros(n), g=np.zeros(0))
    point = EquilibriumPoint(np.zeros(n), np.array(lam), closed, 0.0)
    problem = fake_problem(n, at=lambda *_: values, times=(0.0, 1.0))
    return point_type.classify(
        problem, point, Scales(force, 1.0, np.ones(0), np.ones(0), np.ones(1), np.ones(1)), True
    )[0].kind


@pytest.mark.parametrize(("curvature", "kind"), [(3e-14, "degenerate"), (3e-13, "minimum")])
def test_a_curvature_of_seven_digits_less_is_flat(curvature, kind):
    # Of what a coordinate is measured by, its root of a millionth of the largest at the least.
    assert kind_of(-np.diag([1.0, curvature])) == kind


@pytest.mark.parametrize(("off", "kind"), [(3e-9, "minimum"), (3e-8, None)])
def test_forces_have_no_potential_where_their_gradient_is_asymmetric(off, kind):
    assert kind_of([[-1.0, off / 2], [-off / 2, -1.0]]) == kind


@pytest.mark.parametrize(("push", "carries"), [(3e-10, False), (3e-9, True)])
def test_a_contact_carries_nothing_below_nine_digits_of_the_forces(push, carries):
    problem = fake_problem(K=1, at=lambda *_: SimpleNamespace(F=np.zeros(1)))
    point = EquilibriumPoint(np.zeros(1), np.array([push]), (0,), 0.0)
    assert point_type.carrying(problem, point, scales(contacts=1)) == ((0,) if carries else ())


@pytest.mark.parametrize(("count", "kind"), [(8, "minimum"), (9, "degenerate")])
def test_all_sets_of_eight_contacts_that_carry_nothing_are_gone_through(count, kind):
    # Between the first two only the direction of x is left, along which the curvature is positive.
    walls = np.array([[0.0, 1.0], [0.0, -1.0]] + [[1.0, 0.0]] * (count - 2))
    assert point_type._kind_on_cone(np.diag([1.0, -1.0]), walls, (1, 1), (False, False))[0] == kind


@pytest.mark.parametrize(("width", "is_one"), [(5e-8, True), (5e-7, False)])
def test_a_hundred_narrow_intervals_are_one_piece(width, is_one):
    assert (width <= all_zeros._width(1.0, 0.0)) is is_one
    assert all_zeros._width(1.0, 0.0) > 2e-8


@pytest.mark.parametrize(("left", "x"), [(5e-16, 0.7), (5e-15, 0.70004)])
def test_digits_are_kept_where_rows_hold_to_rounding(left, x):
    class Rows:
        problem = fake_problem(laws=SimpleNamespace(c=SimpleNamespace(numel=lambda: 1)))
        closed = ()

        def __call__(self, x):
            return np.array([left]), np.zeros((1, 1))

    assert singular_rows._rounded(Rows(), np.array([0.70004]), 1.0) == pytest.approx([x], abs=1e-9)
