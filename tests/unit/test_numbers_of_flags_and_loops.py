"""The numbers of flows along rows, and of the loops that show a row to be nonholonomic: on either side another course.

Flows and words are given with known ends, so that each number decides alone.
"""

import itertools
import math
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from lagcli import doubles
from lagcli.analysis.holonomy import controlled_paths, local_system, loop_words, witness, witness_search
from lagcli.analysis.holonomy.loop_words import Goal
from lagcli.analysis.holonomy.witness import LoopTrial
from lagcli.analysis.numeric_flag import evaluation_point, flag_points
from lagcli.expression import term_sizes
from lagcli.linear import rank
from lagcli.start.initial import State

NONE = np.zeros(0, dtype=np.int64)

# Flows along the fields of the rows


@pytest.fixture
def flow(monkeypatch):
    """The substeps of a flow whose values by the midpoint rule are these times a size, and its error."""

    def made(size, pattern=(1.0, -1.0)):
        counts, values = [], itertools.cycle(pattern)

        def path(along, x, scale, count):
            counts.append(count)
            return [np.array([size * next(values)])] * 2

        monkeypatch.setattr(flag_points, "_path", path)
        _, error = flag_points._flow(np.zeros_like, np.zeros(1), np.ones(1))
        return counts, error

    return made


@pytest.mark.parametrize(("off", "count"), [(3e-4, 8), (3e-3, 3)])
def test_a_flow_that_is_off_after_three_extrapolations_is_left(off, count, flow):
    # The third extrapolation of 1, -1, 1 differs from the second by 8/15.
    assert len(flow(off / (8 / 15))[0]) == count


@pytest.mark.parametrize(("error", "is_there"), [(3e-6, True), (3e-5, False)])
def test_a_flow_ends_somewhere_to_five_digits(error, is_there, places, monkeypatch):
    monkeypatch.setattr(flag_points, "_flow", lambda along, x, scale: (x, error))
    assert (places().from_point(Place()) is not None) is is_there


class Place(SimpleNamespace):
    """A place of one variable, with nothing to keep."""

    def __init__(self, x=1.0):
        nothing = rank.Rank(0, 0, np.zeros((0, 0)))
        super().__init__(x=np.array([x]), p=np.zeros(0), independent=[], error=0.0, is_finite=True)
        self.all, self.surface, self.least = nothing, nothing, 1.0


def block(**more):
    """One coordinate without rows."""
    given = {"columns": [0], "size": 1, "has_time": False, "kinds": np.zeros(1, dtype=int)}
    given |= {"pieces": SimpleNamespace(count=0), "holonomic": [], "differential": []}
    given |= {"rows": lambda x, p: (ca.DM(0, 1), ca.DM(0, 1))}
    return SimpleNamespace(**{**given, **more})


@pytest.fixture
def places(monkeypatch):
    """Reachable places of one coordinate along a field of length one."""

    def made(**more):
        monkeypatch.setattr(flag_points, "_projected", lambda A, u: np.ones(1))
        monkeypatch.setattr(flag_points.row_block, "scaled", lambda A, ranges: A)
        monkeypatch.setattr(flag_points, "met", lambda block, x, p, size: Place(float(x[0])))
        monkeypatch.setattr(
            flag_points, "EvaluationPoint", lambda block, x, p, error=0.0: SimpleNamespace(x=x, error=error)
        )
        points = flag_points.Points.__new__(flag_points.Points)
        points._block, points._duration, points._deadline = block(**more), 2.0, math.inf
        points._random = np.random.default_rng(0)
        return points

    return made


def test_a_flow_reaches_a_tenth_of_the_coordinates_and_a_hundredth_of_the_duration(places, monkeypatch):
    scales = []
    monkeypatch.setattr(flag_points, "_flow", lambda along, x, scale: scales.append(scale) or (x, math.inf))
    there = places(has_time=True, size=2)
    monkeypatch.setattr(flag_points, "_projected", lambda A, u: np.ones(2))
    there.from_point(Place(0.5))
    assert scales[0] == pytest.approx([0.05, 0.02])


@pytest.mark.parametrize(("value", "is_on"), [(3e-10, True), (3e-9, False)])
def test_a_switch_within_nine_digits_of_zero_stands_on_neither_side(value, is_on, monkeypatch):
    branches = []
    kinked = block(has_kinks=True)
    kinked.on_branch = lambda x, p, limit: branches.append(bool(abs(value) <= limit)) or kinked
    monkeypatch.setattr(flag_points, "EvaluationPoint", lambda *_: SimpleNamespace(is_finite=True))
    model = SimpleNamespace(simulation=SimpleNamespace(duration=1.0))
    state = State(0.0, np.ones(1), np.zeros(1), np.zeros(0))
    flag_points.Points(kinked, SimpleNamespace(model=model), state, math.inf)
    assert branches == [is_on]


# Words of moves


def goal(size=1.0, closed=(1,)):
    return Goal(np.zeros(3), 0, np.array(closed, dtype=np.int64), size)


class Words(SimpleNamespace):
    """Words with given ends: `offsets` (N, k) of the rough paths, `finer` of the fine ones."""

    def __init__(self, ends, finer=None, moves=1):
        super().__init__(basis=np.ones((1, moves, 1)), asked=[], ends=np.array(ends, dtype=float))
        self.finer = self.ends if finer is None else np.array(finer, dtype=float)

    def offsets(self, goal, X, steps):
        self.asked.append(len(X))
        found = self.finer if steps == 12 else self.ends
        return found[np.arange(len(X)) % len(found)]

    def controls(self, X):
        return X[:, :, None]


@pytest.mark.parametrize(("reach", "is_wild"), [(20.0, False), (30.0, True)])
def test_a_loop_reaches_twenty_five_sizes_at_most(reach, is_wild):
    amount, _ = LoopTrial(goal(), Words([[1.0, reach, 0.0]]), np.ones((1, 1))).ends
    assert math.isnan(amount[0]) is is_wild


@pytest.mark.parametrize(("moved", "is_clear"), [(0.03, False), (0.05, True)])
def test_an_amount_is_worth_showing_from_a_twenty_fifth_of_the_size(moved, is_clear):
    amount, _ = LoopTrial(goal(), Words([[moved, 0.0, 0.0]]), np.ones((1, 1))).ends
    assert math.isfinite(amount[0]) is is_clear


@pytest.mark.parametrize(("miss", "closes"), [(3e-6, True), (3e-5, False)])
def test_a_coordinate_has_come_back_to_five_digits(miss, closes, monkeypatch):
    monkeypatch.setattr(LoopTrial, "first", lambda trial, X: len(X) > 0)
    assert LoopTrial(goal(), Words([[1.0, miss, 0.0]]), np.ones((1, 1))).closing() is closes


@pytest.fixture
def solved_for(monkeypatch):
    """What is asked to be solved for."""
    asked = []
    monkeypatch.setattr(loop_words, "solved", lambda *given: asked.append(given) or np.zeros((0, 1)))
    return asked


@pytest.mark.parametrize(("miss", "is_near"), [(1.2, True), (2.0, False)])
def test_words_that_miss_by_what_they_move_are_solved_for(miss, is_near, solved_for):
    LoopTrial(goal(), Words([[1.0, miss, 0.0]]), np.ones((1, 1))).solved()
    assert bool(solved_for) is is_near


@pytest.mark.parametrize(("change", "is_smooth"), [(3e-5, True), (3e-4, False)])
def test_the_end_of_a_path_stays_with_finer_steps(change, is_smooth, monkeypatch):
    proofs = []
    monkeypatch.setattr(witness, "proved", lambda *given: proofs.append(given))
    words = Words([[1.0, 0.0, 0.0]], [[1.0, change, 0.0]])
    LoopTrial(goal(), words, np.ones((1, 1))).first(np.ones((1, 1)))
    assert bool(proofs) is is_smooth


# The search for a loop


class Part(SimpleNamespace):
    """A part of k coordinates of one row, with the forms A (c, k + 1) everywhere."""

    def __init__(self, k=3, A=None, **more):
        self.A = np.ones((1, k + 1)) if A is None else np.array(A, dtype=float)
        given = {"k": k, "row": 0, "start": np.zeros(k + 1), "scale": np.ones(k + 1), "knows_time": False}
        super().__init__(**{**given, **more})

    def forms(self, Z):
        return np.repeat(self.A[None], len(Z), axis=0)


def search(part=None):
    part = part or Part()
    return witness_search._WitnessSearch(part, part.start, 1.0, False, {})


def test_sizes_of_loops_are_tried_from_usual_ones_to_far_ones(monkeypatch):
    tried = []

    def words(search, are_long=False):
        return [("long_words" if are_long else "words", search.size)]

    monkeypatch.setattr(witness_search._WitnessSearch, "words", words)
    monkeypatch.setattr(witness_search._WitnessSearch, "paths", lambda search: [("paths", search.size)])
    for attempt in ("closing", "solved", "shaped"):
        monkeypatch.setattr(
            LoopTrial, attempt, lambda trial, attempt=attempt: tried.append((trial[0], attempt, trial[1]))
        )
    monkeypatch.setattr(witness_search.controlled_paths, "is_singular", lambda *_: False)
    assert witness_search._found([Part()], True, 0) is None
    usual = (1.0, 0.5, 0.2, 0.1)
    assert tried == [
        *(("words", attempt, size) for attempt in ("closing", "solved") for size in usual),
        *(("long_words", "shaped", size) for size in usual),
        ("paths", "shaped", 1.0),
        ("paths", "shaped", 0.5),
        *(("words", "closing", size) for size in (0.02, 10.0, 100.0, 1e-3)),
    ]


def bent_place(angle, q=(0.0, 0.0, 0.0), names=("x", "y", "z")):
    """Where a configuration is bent to, of one row that turns by `angle` (of its first coordinate) at the start."""
    places = []

    def rows(t, q, v, p):
        turn = angle(float(q[0]))
        return ca.DM([[math.cos(turn), math.sin(turn)] + [1e-30] * (len(q) - 2)]), None

    state = State(0.0, np.array(q), np.zeros(len(q)), np.zeros(0))
    system = SimpleNamespace(holonomic_count=1, model=SimpleNamespace(generalized_names=names))
    surface = SimpleNamespace(descend=lambda q: places.append(q) or SimpleNamespace(is_on=False))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(witness_search.projection, "Surface", lambda *_: surface)
        patch.setattr(witness_search.initial, "metric_at", lambda *_: None)
        witness_search._bent(system, SimpleNamespace(rows=rows), state, 0, 0)
    return places[0], np.random.default_rng(0).standard_normal(len(q))


def test_holonomic_rows_are_turned_by_half_a_radian():
    place, noise = bent_place(lambda x: x)
    # The first coordinate alone turns the row.
    assert place * noise[0] / noise == pytest.approx(0.5 * np.sign(noise[0]), rel=1e-4)


def test_particles_are_drawn_together_to_seven_tenths():
    start = np.array([1.0, 2.0, 3.0, 5.0, 7.0, 9.0])
    place, noise = bent_place(lambda x: 0.0, start, ())
    between = np.subtract(*(place - 0.5 * noise).reshape(2, 3))
    assert between == pytest.approx(0.7 * np.subtract(*start.reshape(2, 3)))


def frames(A, k, rank, along=0):
    kernel = np.zeros((k, k - rank))
    patch = pytest.MonkeyPatch()
    with patch.context() as one:
        paths = witness_search.controlled_paths
        one.setattr(paths, "projected", lambda *_: None)
        one.setattr(paths, "ends", lambda frame, base, out, steps: np.zeros((3, k + 1)))
        one.setattr(paths, "along_axes", lambda part, chosen, led, free: tuple(led.tolist()))
        return search(Part(k, A))._frames(SimpleNamespace(kernel=kernel), along)


@pytest.mark.parametrize(("angle", "count"), [(5e-6, 1), (3e-6, 0)])
def test_led_coordinates_have_a_pole_from_a_condition_of_a_million(angle, count):
    # The rows differ in the third coordinate; led are the first and the second, or the first and the third.
    A = [[1.0, 1.0, 0.0, 0.0], [1.0, 1.0 + angle, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]
    assert len(frames(A, 3, 3)) == count


@pytest.mark.parametrize(("others", "count"), [(200, 2), (201, 0)])
def test_up_to_two_hundred_sets_of_coordinates_all_are_tried(others, count, monkeypatch):
    orbit = SimpleNamespace(tangent=np.zeros((others + 2, 2)), lift=lambda closed: np.ones((others + 2, 1)))
    monkeypatch.setattr(witness_search._WitnessSearch, "_is_crossed", lambda search, lift: True)
    assert len(list(search(Part(others + 1))._goals(orbit, 0, NONE))) == count


@pytest.mark.parametrize(("missing", "count"), [(1, 2), (2, 1)])
def test_of_one_condition_two_goals_are_tried_and_of_more_one(missing, count, monkeypatch):
    orbit = SimpleNamespace(tangent=np.zeros((7, 1 + missing)), lift=lambda closed: np.ones((7, 1)))
    monkeypatch.setattr(witness_search._WitnessSearch, "_is_crossed", lambda search, lift: True)
    assert len(list(search(Part(6))._goals(orbit, 0, NONE))) == count


# Lengths that are solved for


class Solving:
    """Words of one length whose misses are given, with the gradient J; what is asked for is recorded."""

    def __init__(self, monkeypatch, misses, J=None, closed=1):
        self.left, self.J, self.closed = iter(misses), np.eye(closed) if J is None else J, closed
        self.X, self.rough, self.fine = [], [], []
        self.basis, self.frame, self.rest = np.ones((1, 1, closed)), None, None
        monkeypatch.setattr(loop_words.controlled_paths, "turned", self._turned)
        monkeypatch.setattr(loop_words.controlled_paths, "ends", self._ends)

    def controls(self, X):
        self.X.append(X.copy())
        return X

    def resting(self, goal, steps):
        return np.zeros(1 + self.closed)

    def _miss(self, count):
        found = np.zeros((count, 1 + self.closed))
        found[:, 1:] = next(self.left)
        return found

    def _turned(self, frame, start, controls, basis, steps):
        self.rough.append(steps)
        J = np.zeros((len(controls), 1 + self.closed, self.closed))
        J[:, 1:] = self.J
        return self._miss(len(controls)), J

    def _ends(self, frame, start, controls, steps):
        self.fine.append(steps)
        return self._miss(len(controls))

    def solve(self):
        count = self.closed
        wanted = goal(closed=tuple(range(1, 1 + count)))
        return loop_words.solved(self, wanted, np.zeros((1, count)), np.ones((1, count), dtype=bool))


def test_lengths_are_solved_for_with_rough_paths_and_then_with_fine_ones(monkeypatch):
    words = Solving(monkeypatch, [1e-7, 1e-15])
    assert len(words.solve()) == 1
    assert (words.rough, words.fine) == ([2], [12])


@pytest.mark.parametrize(("miss", "rough"), [(3e-6, 1), (3e-5, 2)])
def test_rough_paths_come_near_to_five_digits(miss, rough, monkeypatch):
    words = Solving(monkeypatch, [miss, 0.0, 0.0])
    words.solve()
    assert len(words.rough) == rough


@pytest.mark.parametrize(("ratio", "turns"), [(0.65, 16), (0.75, 4)])
def test_a_start_that_does_not_contract_after_three_turns_is_left(ratio, turns, monkeypatch):
    words = Solving(monkeypatch, (ratio**k for k in range(400)))
    words.solve()
    assert len(words.rough) == turns


def test_trial_lengths_are_halves_and_wholes_or_twelve_at_random():
    _, few = loop_words.loops(None, 2, (0, 1), np.ones(2), 1)
    assert np.unique(few).tolist() == [-4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0]
    _, many = loop_words.loops(None, 2, (0, 1), np.ones(2), 2)
    assert len(many) == 12


# The orbit of a start


@pytest.mark.parametrize(("angle", "has_lift"), [(3e-6, False), (3e-5, True)])
def test_a_direction_of_an_orbit_is_seen_to_five_digits(angle, has_lift):
    orbit = controlled_paths.PathOrbit(np.array([[1.0], [angle]]), np.zeros((1, 1)), True)
    assert (orbit.lift(np.array([1])) is not None) is has_lift


def test_a_start_is_singular_where_three_points_a_tenth_beside_it_are_not(monkeypatch):
    looks, outs = [], []

    def ends(frame, point, out, steps):
        outs.append(out)
        return np.zeros((len(out), 901))

    monkeypatch.setattr(
        controlled_paths, "_kernel", lambda part, point: looks.append(1) or np.zeros((900, 900))
    )
    monkeypatch.setattr(controlled_paths, "projected", lambda *_: None)
    monkeypatch.setattr(controlled_paths, "ends", ends)
    assert not controlled_paths.is_singular(None, np.zeros(901))
    assert len(looks) == 1 + 3
    assert np.linalg.norm(outs[0][0]) / 30 == pytest.approx(0.1, rel=0.1)


def explored(monkeypatch, off, count=1):
    """An orbit by paths of which `count` in 20 are this much off, and what was asked for."""
    asked = []

    def returned(frame, point, out, control, size, steps):
        asked.append((out.shape, steps))
        found = np.ones((20, 1))
        found[:count] += off * (len(asked) == 1)
        return found

    monkeypatch.setattr(controlled_paths, "_returned", returned)
    monkeypatch.setattr(controlled_paths, "_kernel", lambda part, point: np.zeros((49, 1)))
    return controlled_paths.through(None, np.zeros(50), 1.0, False).is_explored, asked


@pytest.mark.parametrize(("lost", "is_explored"), [(3, True), (5, False)])
def test_an_orbit_is_explored_where_four_in_five_paths_come_back(lost, is_explored, monkeypatch):
    assert explored(monkeypatch, 1.0, lost)[0] is is_explored


def test_fields_are_carried_back_from_the_step_of_a_quotient_on_both_sides(monkeypatch):
    begins = []

    def ends(frame, points, out, steps):
        begins.append(np.array(points))
        return np.zeros((len(out), 2))

    monkeypatch.setattr(controlled_paths, "ends", ends)
    monkeypatch.setattr(controlled_paths, "velocity", lambda frame, far, u: np.ones(far.shape))
    controlled_paths._returned(None, np.zeros(2), np.zeros((3, 1, 2)), np.eye(1, 2), 1.0, 2)
    assert [float(points.max()) for points in begins[1:]] == pytest.approx([doubles.STEP, -doubles.STEP])


# The units of a part, and brackets of fields


def local_part(slope):
    """A part of one coordinate, whose row has this slope beside 1, at zero."""
    part = object.__new__(local_system.LocalPart)
    part.__dict__["state"] = State(0.0, np.zeros(1), np.zeros(1), np.zeros(0))
    part.__dict__["coordinates"] = np.zeros(1, dtype=int)

    def forms(Z):
        return np.array([[[1.0, slope(z[0])]] for z in Z])

    part.__dict__["_forms"] = forms
    return part


@pytest.mark.parametrize(("length", "unit"), [(3e4, 1e4), (3e5, 1.0), (3e-5, 1e-5), (3e-6, 1.0)])
def test_units_of_a_part_are_within_five_digits_of_one(length, unit):
    assert local_part(lambda x: x / length).scale[0] == pytest.approx(unit)


@pytest.mark.parametrize(
    ("turning", "error", "count"), [(3e-7, 0.0, 0), (3e-6, 0.0, 1), (3e-6, 1e-7, 0), (3e-5, 1e-7, 1)]
)
def test_a_bracket_is_certain_from_six_digits_and_a_hundred_errors_of_the_point(turning, error, count):
    point = object.__new__(evaluation_point.EvaluationPoint)
    point.error = error
    point.__dict__["turning"] = np.array([turning])
    assert point.first == count


@pytest.mark.parametrize(("off", "is_near"), [(3e-13, True), (3e-12, False)])
def test_a_value_within_twelve_digits_of_a_switch_may_lie_on_either_side(off, is_near):
    _, size = term_sizes.result("floor", (1.0 + off, 1.0))
    assert (size == math.inf) is is_near
