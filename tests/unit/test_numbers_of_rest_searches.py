"""The numbers of the searches for points of rest: two inputs beside each, with different answers.

The searches are given equations with known steps and ends, so that each number decides alone.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from mpmath import iv

import lagcli
from lagcli import doubles
from lagcli.statics import (
    all_zeros,
    continuum,
    point_search,
    point_type,
    refine,
    rest_equations,
)
from lagcli.statics.continuum import FoundPoint
from lagcli.statics.point_search import PointSearch, SearchOptions
from lagcli.statics.point_type import PointType
from lagcli.statics.rest_equations import EquilibriumPoint, RestEquations, Scales


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
    given |= {"evaluations": 0, "p": np.zeros(0), "is_large": n + C > 60}
    given |= {"laws": SimpleNamespace(c=SimpleNamespace(numel=lambda: 0))}
    given |= {"nothing": np.zeros(C + K), "contact_sets": lambda: iter([()])}
    given |= {"acting": lambda closed: [*range(C), *(C + k for k in closed)]}
    return SimpleNamespace(**{**given, **more})


def fake_equations(problem=None, **more):
    given = {"problem": problem or fake_problem(), "scales": scales(), "contacts": [], "size": 1}
    return SimpleNamespace(**{**given, **more})


# Newton's steps and damped ones


def test_damped_steps_end_where_newton_takes_over():
    halved = Shrinking(0.5)
    refine.lowered(halved, np.zeros(1), halved(None), 200, doubles.ROOT)
    assert halved.calls == 1 + 20  # 2**-20 is the root of what a value is known to


def test_a_slope_of_rounding_is_the_bottom_of_a_valley():
    for slope, steps in ((3e-15, 0), (3e-14, 1)):
        calls = []

        def valley(x, slope=slope, calls=calls):
            calls.append(x)
            return np.array([1.0, slope - x[0]]), np.array([[0.0], [-1.0]])

        refine.lowered(valley, np.zeros(1), valley(np.zeros(1)), 1, doubles.ROOT)
        assert len(calls) == 1 + steps


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


@pytest.mark.parametrize(("left", "is_one"), [(3e-7, True), (3e-6, False)])
def test_a_walk_has_arrived_where_a_millionth_is_left(left, is_one, monkeypatch):
    monkeypatch.setattr(continuum, "is_straight", lambda *_: False)
    monkeypatch.setattr(continuum, "directions", lambda *_: np.eye(1))
    monkeypatch.setattr(continuum, "stepped", lambda *_: None)
    assert continuum.connected(fake_equations(), np.zeros(1), np.array([left]), 1) is is_one


def test_points_at_equal_distances_are_no_straight_continuum(along_x, monkeypatch):
    assert continuum.is_straight(fake_equations(), np.zeros(1), np.ones(1))
    assert len(along_x.lengths) == 8
    assert max(along_x.lengths) == 1.0
    for count in range(1, 11):

        def stepped(equations, x, change, count=count):
            return x + change if abs(math.sin(math.pi * count * change[0])) < 1e-3 else None

        monkeypatch.setattr(continuum, "stepped", stepped)
        assert not continuum.is_straight(fake_equations(), np.zeros(1), np.ones(1))


# Further zeros


class Line(SimpleNamespace):
    """F(x) = x - zero."""

    def __call__(self, x):
        self.calls = getattr(self, "calls", 0) + 1
        return x - self.zero, np.eye(1)


def line(zero):
    return Line(zero=zero, problem=fake_problem(), scales=scales())


@pytest.mark.parametrize(("off", "count"), [(3e-8, 0), (3e-7, 1)])
def test_a_start_that_is_a_zero_has_no_path(off, count):
    assert len(list(refine.near_zeros(line(0.0), np.array([off])))) == count


# The refinement of a point


@pytest.mark.parametrize(
    ("step", "left", "is_point"),
    [(3e-6, 0.0, True), (3e-5, 0.0, False), (0.0, 3e-10, True), (0.0, 3e-9, False)],
)
def test_a_point_is_settled_and_balanced(step, left, is_point):
    values = SimpleNamespace(
        F=np.zeros(1), c=np.zeros(0), g=np.zeros(0), rows=lambda closed: np.zeros((0, 1))
    )
    equations = fake_equations(
        fake_problem(at=lambda *_: values),
        split=lambda x: (x, [np.zeros(0)]),
        all_multipliers=lambda each: each,
        unbalanced=lambda x: left,
    )
    found = RestEquations.settled(equations, np.zeros(1), step)
    assert found.rests is is_point


@pytest.mark.parametrize(("gap", "touches"), [(3e-10, True), (3e-9, False)])
def test_a_contact_is_closed_to_nine_digits(gap, touches):
    problem = fake_problem(K=1, at=lambda *_: SimpleNamespace(g=np.array([gap])))
    point = EquilibriumPoint(np.zeros(1), np.zeros(1), (), 0.0)
    assert RestEquations(problem, (), scales(contacts=1)).touching(point) == ((0,) if touches else ())


# The search for all points


@pytest.fixture
def search_of(monkeypatch):
    """A search over a problem without laws."""
    monkeypatch.setattr(rest_equations, "scales", lambda problem, q: scales(contacts=problem.K))

    def made(n=1, K=0, C=0, has_potential=True, **more):
        options = SearchOptions(has_potential, True, (False,) * n, 0)
        return PointSearch(fake_problem(n, C=C, K=K, **more), options)

    return made


def found_point(x, kind="minimum", closed=()):
    point = EquilibriumPoint(np.array([x]), np.zeros(1), closed, 0.0)
    return FoundPoint(point, PointType(kind, 0, True, kind != "degenerate"), 0, ())


@pytest.mark.parametrize(("kind", "limit"), [("minimum", 1e-6), ("degenerate", 3e-4)])
def test_points_that_are_one_are_kept_once(kind, limit, search_of):
    search = search_of()
    search.points = [found_point(0.0, kind)]
    of_flat = point_search.PARAMETERS.same_of_flat
    assert search._is_known(found_point(0.3 * limit).point, of_flat)
    assert not search._is_known(found_point(3 * limit).point, of_flat)


def test_starts_are_drawn_beside_across_and_beyond(search_of):
    search = search_of(n=900)
    away = [np.linalg.norm(q) / 30 for q in search.others(4)]
    assert away == pytest.approx([0.0, 1.0, 2.5, 0.3], rel=0.1)


def test_the_first_start_takes_a_quarter_of_the_budget(search_of, monkeypatch):
    search, allowed = search_of(), []
    monkeypatch.setattr(search, "_start", lambda begin: allowed.append(search._allowed) or [])
    search.run(2)
    assert allowed == pytest.approx([1.5e7 / 4, 1.5e7 / 2, 1.5e7])


# One unknown, by intervals


@pytest.mark.parametrize(("zero", "is_found"), [(3e5, True), (3e6, False)])
def test_all_zeros_of_one_unknown_lie_within_a_million_sizes(zero, is_found):
    isolated, undecided = all_zeros.pieces(lambda x: (x - zero, iv.mpf(1)), 1.0, False)
    assert bool(isolated) is is_found
    assert bool(undecided) is not is_found


def test_an_interval_of_a_turn_overlaps_itself():
    _, pieces = all_zeros.pieces(lambda x: (iv.mpf([-1, 1]), iv.mpf([-1, 1])), 1.0, True)
    low, high = min(low for low, _ in pieces), max(high for _, high in pieces)
    assert 0 < high - low - 2 * math.pi < 1e-11


@pytest.mark.parametrize(("width", "is_known"), [(0.006, True), (0.0035, False)])
def test_four_thousand_intervals_are_looked_at(width, is_known):
    looks = []

    def force(x):
        looks.append(x)
        return iv.mpf([1, 2] if x.delta < width else [-1, 1]), iv.mpf([-1, 1])

    assert (not all_zeros.pieces(force, 1.0, True)[1]) is is_known
    assert 2000 < len(looks) <= 4000


def test_a_double_zero_is_enclosed_to_nine_digits():
    _, pieces = all_zeros.pieces(lambda x: ((x - 0.3) ** 2, 2 * (x - 0.3)), 1.0, True)
    width = max(high for _, high in pieces) - min(low for low, _ in pieces)
    assert 3e-10 < width < 3e-9


@pytest.mark.parametrize(("count", "is_more"), [(4, False), (5, True)])
def test_four_undecided_pieces_are_named(count, is_more):
    """A function with so many poles."""
    model = lagcli.loads("lagcli: 1\ncoordinates: {x: {value: 7.3}}\nlagrangian: rate(x)**2/2\n")
    poles = "x**2 + " + " + ".join(f"log(abs(x - {k}))" for k in range(count))
    told = next(note for note in lagcli.stationary(model, poles, starts=0).notes if "intervals" in note)
    assert told.count("near") == 4
    assert ("elsewhere" in told) is is_more


# The kind of a point


def kind_of(K, lam=(), closed=(), force=1.0):
    """The type of a point with this gradient of the forces, of a problem that depends on t."""
    n, K = len(K), np.array(K, dtype=float)
    nothing = np.zeros((0, n))
    values = SimpleNamespace(B=nothing, G=nothing, K=K, F=np.zeros(n), g=np.zeros(0), rows=lambda _: nothing)
    point = EquilibriumPoint(np.zeros(n), np.array(lam), closed, 0.0)
    problem = fake_problem(n, at=lambda *_: values, times=(0.0, 1.0))
    units = Scales(force, 1.0, np.ones(0), np.ones(0), np.ones(1), np.ones(1))
    return point_type.classify(RestEquations(problem, (), units), point, True)[0].kind


@pytest.mark.parametrize(("curvature", "kind"), [(3e-14, "degenerate"), (3e-13, "minimum")])
def test_a_curvature_of_seven_digits_less_is_flat(curvature, kind):
    # Of what a coordinate is measured by, its root of a millionth of the largest at the least.
    assert kind_of(-np.diag([1.0, curvature])) == kind


@pytest.mark.parametrize(("push", "carries"), [(3e-10, False), (3e-9, True)])
def test_a_contact_carries_nothing_below_nine_digits_of_the_forces(push, carries):
    problem = fake_problem(K=1, at=lambda *_: SimpleNamespace(F=np.zeros(1)))
    point = EquilibriumPoint(np.zeros(1), np.array([push]), (0,), 0.0)
    equations = RestEquations(problem, (), scales(contacts=1))
    assert point_type.carrying(equations, point) == ((0,) if carries else ())


@pytest.mark.parametrize(("count", "kind"), [(8, "minimum"), (9, "degenerate")])
def test_all_sets_of_eight_contacts_that_carry_nothing_are_gone_through(count, kind):
    # Between the first two only the direction of x is left, along which the curvature is positive.
    walls = np.array([[0.0, 1.0], [0.0, -1.0]] + [[1.0, 0.0]] * (count - 2))
    assert point_type.kind_on_cone(np.diag([1.0, -1.0]), walls, (1, 1), (False, False))[0] == kind
