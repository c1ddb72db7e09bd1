"""The numbers that steps, their errors and what stands in their way are judged by: on either side another answer."""

import math
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

import lagcli
from lagcli import doubles
from lagcli.model.settings import Simulation
from lagcli.simulation import error_estimate, loop, reference_run
from lagcli.simulation.closed_contacts import contact_change
from lagcli.simulation.closed_contacts.contact_instant import ContactInstant
from lagcli.simulation.events.singular_event import SingularEvent
from lagcli.simulation.loop import RunStart
from lagcli.simulation.scheme import bound_scheme, step_end, step_tolerance
from lagcli.simulation.singularity import singularity_monitor, singularity_step
from lagcli.simulation.singularity.singularity_monitor import Prediction, SingularityMonitor
from lagcli.simulation.stepping import interpolate_rows, stop_diagnosis
from lagcli.smoothness.sides import Sides
from lagcli.start.initial import State

NOTHING = np.zeros(0)


def relatively(value):
    """The value to six digits, however small it is."""
    return pytest.approx(value, rel=1e-6, abs=0.0)


def settings(rtol, atol=None):
    return Simulation(duration=1.0, samples=2, rtol=rtol, atol=atol)


def of_steps(rtol, atol=None):
    return step_tolerance.of_steps(settings(rtol, atol)).tolist()


# From the tolerance of a run to that of a step


def test_steps_have_a_hundredth_of_the_tolerance():
    assert of_steps(1e-6)[0] == relatively(1e-8)
    assert of_steps(1e-6, 1e-9)[1] == relatively(1e-11)


def test_a_step_has_fourteen_digits_at_most():
    assert of_steps(1e-13)[0] == relatively(1e-14)
    assert of_steps(1e-15)[0] == relatively(1e-15)


def test_without_atol_thirteen_digits_are_asked_for():
    assert of_steps(1e-6)[2] == relatively(1e-15)


def test_the_absolute_tolerance_has_bounds():
    assert of_steps(5e-12)[2] == relatively(5e-16)  # a hundredth of 5e-14
    assert of_steps(1e-15)[2] == relatively(1e-16)  # and not a hundredth of 1e-15


def test_rounding_is_that_of_sixteen_stages():
    class Roundings:
        arguments, results = [np.zeros(1)], [np.array([np.zeros(3), [1.0, 2.0, np.inf]])]

        def trigger(self):
            pass

    assert bound_scheme.BoundStep._rounded(Roundings(), 0.0) == pytest.approx([2**-49, 2**-48, 0.0], abs=0.0)


def test_terms_that_begin_at_zero_are_seen_a_millionth_of_a_row_later():
    looked = []

    class Numeric:
        has_time = True

        def state_roundings(self, t, *state):
            looked.append(t)
            return np.array([np.ones(3), np.zeros(3)])

    assert not step_tolerance.is_blurred(Numeric(), State(2.0, np.zeros(1), np.zeros(1), np.zeros(0)), 0.5)
    assert looked == [2.0, 2.0 + 0.5 * doubles.ROOT]


# The scale of the error of a step

HELD = ca.DM([0.0] * step_tolerance.COUNT)


def scale(q=0.0, v=0.0, a=0.0, h=1.0, tolerance=HELD):
    """The scales of position and velocity of a state at zero, of sizes q, v and a."""
    return step_end.scales((ca.DM([0, 0, 0]),) * 2, h, ca.DM([1, q, v, a]), tolerance).full().ravel()


def test_rounding_of_positions_shows_in_velocities():
    assert scale(q=1.0, v=1.0, h=1e-3, tolerance=ca.DM(of_steps(1e-6)))[1] == relatively(2e-14 / 2 + 1e-15)


@pytest.mark.parametrize(("size", "floor"), [(3e-7, 1e-14), (3e-6, 0.0)])
def test_forces_hold_positions_at_the_origin(size, floor):
    assert scale(q=size, v=1.0, a=1.0)[1] == pytest.approx(floor, abs=1e-30)


@pytest.mark.parametrize(("speed", "floor"), [(3e-13, 1e-15), (3e-12, 0.0)])
def test_speeds_that_balanced_forces_make_by_rounding_are_rest(speed, floor):
    assert scale(q=1.0, v=speed, a=1.0, h=0.1)[1] == pytest.approx(floor, abs=1e-30)


@pytest.mark.parametrize(("angle", "gains"), [(3e-3, True), (3e-2, False)])
def test_close_rows_amplify_rounding(angle, gains):
    gained = step_end._amplified(1, ca.DM(angle**2), ca.DM([1, 1, 1, 2]), ca.DM(1.0)).full().ravel()
    assert gained[1] == pytest.approx(2e-16 / angle**3 if gains else 0.0)


@pytest.mark.parametrize(
    ("by", "size", "is_allowed"),
    [(3e-8, 0.0, True), (3e-7, 0.0, False), (3e-11, 1.0, True), (3e-10, 1.0, False)],
)
def test_a_projection_moves_little(by, size, is_allowed):
    moved = step_end._moved(ca.DM([by, 0]), ca.DM([1e-30 if size else 1e-9, 1.0]), ca.DM([1, size, 0, 0]))
    assert (float(moved) <= 1.0) is is_allowed


def test_the_work_of_forces_that_balance_is_judged_by_their_rounding():
    judge = step_end._judge(ca.SX, 3, 1, lambda h, estimate: estimate)
    work = ca.DM([0, 0, 2**-52])
    state = ca.DM([0, 0, 0])
    judged = judge(state, state, state, 1.0, ca.DM([1, 1, 0, 1]), HELD, state, state, work)
    assert float(judged[2]) == pytest.approx(1.0)


@pytest.mark.parametrize(("gained", "factor"), [(3e-10, 1025.0), (3e-9, 1.0)])
def test_a_step_of_a_few_roundings_may_hold_a_jump(gained, factor):
    near_t, h = 1e-16, 1024e-16
    change = ca.DM([0, gained / h, 0])
    found = step_end._within(near_t, h, (ca.DM([0, 1, 0]), ca.DM([0, 0, 0]), change))
    assert float(found) == pytest.approx(factor)


@pytest.mark.parametrize(("n", "sort"), [(499, ca.SX), (500, ca.MX)])
def test_steps_of_a_thousand_numbers_are_written_out(n, sort, monkeypatch):
    sorts = []

    def judge(sort, *form):
        sorts.append(sort)
        return lambda *_: None

    monkeypatch.setattr(step_end, "_judge", judge)
    state = ca.MX.zeros(2 * n + 1)
    numeric = SimpleNamespace(
        n=n, has_time=False, project=lambda t, y, p: (y, y, ca.MX.zeros(3), ca.MX.ones(n + 3))
    )
    step = [ca.MX(0), ca.MX(1), state, state, ca.MX.zeros(6), ca.MX.zeros(0)]
    step_end.ended(numeric, step, state, [state], lambda h, estimate: estimate)
    assert sorts == [sort]


# Gradients of contacts


class Gap:
    """A contact at one coordinate, of which gap and gradient are functions; `looks` are the places asked for."""

    has_gradient = near = np.array([True])
    units = np.ones(1)
    displaced = ContactInstant.displaced

    def __init__(self, gap, gradient=None, q=0.0, touching=1e-12, looks=None):
        self.gap, self.gradient = gap, gradient or (lambda x: 1.0)
        self.state = State(0.0, np.array([q]), np.zeros(1), NOTHING)
        self.g, self.size = np.array([gap(q)]), 1.0
        self.touching_gap = np.array([touching])
        self.looks = [] if looks is None else looks

    def direction(self, contact):
        return np.ones(1), 1.0

    def entries(self, contact):
        return np.array([self.gradient(float(self.state.q[0]))])

    def at(self, state):
        x = float(state.q[0])
        self.looks.append(x)
        return Gap(self.gap, self.gradient, x, looks=self.looks)


@pytest.mark.parametrize(("part", "is_reported"), [(3e-4, True), (3e-3, False)])
def test_a_fallen_gradient_is_looked_at(part, is_reported):
    here = SimpleNamespace(g=np.zeros(1), lowest=np.array([part]))
    assert contact_change.fallen(here, np.ones(1), [0]).tolist() == [is_reported]


@pytest.mark.parametrize(("bend", "vanishes"), [(0.2, False), (1.0, True)])
@pytest.mark.parametrize(("gap", "offset"), [(0.0, 1e-10), (1e-6, 1e-5)])
def test_a_gradient_that_tells_no_change_vanishes(bend, vanishes, gap, offset):
    here = Gap(lambda x: gap + x + bend / offset * x * abs(x))
    assert contact_change._vanishes(here, 0) is vanishes


@pytest.mark.parametrize(("edge", "jumps"), [(3e-12, True), (3e-11, False)])
def test_sides_of_a_jump_are_ten_closed_gaps_apart(edge, jumps):
    here = Gap(lambda x: x, lambda x: 1.0 + (abs(x) > edge))
    assert contact_change._jumps(here, 0) is jumps


def test_three_pairs_of_sides_are_compared():
    here = Gap(lambda x: x)
    contact_change._jumps(here, 0)
    assert len(here.looks) == 3 * 2 * 2


@pytest.mark.parametrize(("size", "jumps"), [(3e-7, False), (3e-6, True)])
def test_the_gradient_of_a_contact_jumps_by_a_millionth_of_itself(size, jumps):
    here = Gap(lambda x: x, lambda x: 1.0 + size * (x > 0))
    assert contact_change._jumps(here, 0) is jumps


@pytest.mark.parametrize(
    ("near", "edge", "jumps"), [(0.05, 2e-10, False), (0.5, 2e-10, True), (0.05, 2e-9, True)]
)
def test_a_jump_stays_from_a_hundred_times_farther_off(near, edge, jumps):
    here = Gap(lambda x: x, lambda x: 1.0 + (0.0 if x == 0 else near if abs(x) < edge else 1.0))
    assert contact_change._jumps(here, 0) is jumps


@pytest.mark.parametrize(
    ("first", "second", "is_edge"),
    [(3e-7, 1.0, True), (3e-6, 1.0, False), (0.0, 3e-5, False), (0.0, 3e-4, True)],
)
def test_an_edge_is_looked_for_a_little_before_and_behind_a_state(first, second, is_edge):
    def contacts(t, q, v, p):
        x = float(q[0])
        return None, ca.DM([1.0 + 0.05 * (x > first) + (x > second)])

    numeric = SimpleNamespace(selection=SimpleNamespace(count=1), closed_rows=(0,), contacts=contacts)
    state = State(0.0, np.zeros(1), np.ones(1), NOTHING)
    found = contact_change.edges(numeric, state, np.array([True]), 1.0)
    assert found == ((0,) if is_edge else ())


@pytest.mark.parametrize(("size", "is_edge"), [(3e-7, False), (3e-6, True)])
def test_an_edge_is_a_jump_by_a_millionth(size, is_edge):
    numeric = SimpleNamespace(
        selection=SimpleNamespace(count=1),
        closed_rows=(0,),
        contacts=lambda t, q, v, p: (None, ca.DM([1.0 + size * (float(q[0]) > 0)])),
    )
    state = State(0.0, np.zeros(1), np.ones(1), NOTHING)
    assert bool(contact_change.edges(numeric, state, np.array([True]), 1.0)) is is_edge


# Singular configurations foreseen


@pytest.mark.parametrize(("before", "now", "is_foreseen"), [(1.1, 0.95, False), (1.0, 0.85, True)])
def test_angles_that_are_wide_are_not_followed(before, now, is_foreseen):
    monitor = SingularityMonitor((0.0, math.sin(before) ** 2, 1.0, 1.0))
    assert monitor.after(1.0, math.sin(now) ** 2, 1.0).foreseen.is_any is is_foreseen


@pytest.mark.parametrize(
    ("rtol", "angle", "step", "steps"),
    [
        (1e-6, 1.0, 1.0, 2.02),
        (1e-11, 1.0, 1.0, 4.14),
        (1e-6, 6e-4, 1.0, 2.02),
        (1e-6, 3e-4, 1.0, 12.1),
        (1e-6, 1.0, 1 / 3, 2.02),
        (1e-6, 1.0, 1 / 5, 72.6),
    ],
)
def test_a_step_across_begins_some_steps_before(rtol, angle, step, steps):
    for left, is_near in ((0.99 * steps, True), (1.01 * steps, False)):
        assert Prediction(left, 1, angle=angle, step=step).is_near(0.0, 1.0, rtol, 8) is is_near


def test_an_ordinary_step_goes_part_of_the_way_to_the_instant():
    assert Prediction(1.0, 1).shortened(0.0, 1.0) == pytest.approx(0.6)
    assert Prediction(1.0, 1).shortened(0.0, 0.5) == 0.5


def dip(least, at=0.75, ahead=1.0):
    """Whether a parabola of that minimum, at that part of the time ahead, is one; and the times that are asked for."""
    asked = []

    def square(h):
        asked.append(h)
        return least + (1 - least) * (h / at - 1) ** 2

    return singularity_monitor.is_dip(square, 1.0, ahead), asked


@pytest.mark.parametrize(("least", "is_one"), [(0.003, False), (0.03, True)])
def test_a_minimum_of_a_hundredth_of_the_square_is_no_zero(least, is_one):
    assert dip(least)[0] is is_one


def test_a_minimum_is_looked_for_up_to_twice_the_time():
    assert max(dip(0.3, at=4.0)[1]) == pytest.approx(2.0)


@pytest.mark.parametrize(("at", "looks"), [(0.51, 2), (0.53, 3)])
def test_looks_that_are_close_together_say_nothing_new(at, looks):
    assert len(dip(0.5, at=at)[1]) == looks


def test_a_minimum_is_looked_for_at_four_points():
    asked = []

    def square(h):
        asked.append(h)
        return 0.2 + max((0.8 - h) ** 3, 25 * (h - 0.8))

    singularity_monitor.is_dip(square, 0.2 + 0.8**3, 1.0)
    assert len(asked) == 2 + 4


# Steps across singular configurations


def test_the_zero_of_a_cubic_is_found_to_rounding():
    x = np.array([-0.3, -0.1, 0.1, 0.3])
    zero, _ = singularity_step._zero(x, -(x - 0.04) * (1 + 0.5 * x + 2.0 * x**2))
    assert zero == pytest.approx(0.04, abs=1e-15)


@pytest.fixture
def looks_for_the_instant(monkeypatch):
    """The instants that are found one after the other, each this part of the way from the last."""

    def made(shifts):
        asked, left = [], iter(shifts)
        step = SimpleNamespace(t=0.0, h=1.0)

        def improved(project, step_, h, nodes, rtol):
            asked.append((h, nodes))
            return step

        def instant(root, guess, width):
            shift = next(left, None)
            return None if shift is None else (guess * (1 + shift), 1.0)

        monkeypatch.setattr(singularity_step.collocation, "rising", lambda *_: step)
        monkeypatch.setattr(singularity_step.collocation, "improved", improved)
        monkeypatch.setattr(singularity_step, "_instant", instant)
        monkeypatch.setattr(singularity_step, "_is_only_one", lambda *_: True)
        monkeypatch.setattr(singularity_step, "_agree", lambda *_: True)
        here = SimpleNamespace(t=0.0, y=np.zeros(3), k=np.zeros(3), tolerance=np.zeros(6))
        found = singularity_step._placed(None, here, Prediction(1.0, 1), 0.5)
        return found, asked

    return made


@pytest.mark.parametrize(("shift", "looks"), [(0.03, 1), (0.05, 2)])
def test_an_instant_is_found_until_it_is_centered(shift, looks, looks_for_the_instant):
    found, asked = looks_for_the_instant([shift, 0.0])
    assert found is not None
    assert [nodes for _, nodes in asked] == [10] * looks + [8]


def test_an_instant_is_looked_for_six_times(looks_for_the_instant):
    found, asked = looks_for_the_instant([0.3] * 100)
    assert found is None
    assert len(asked) == 6


def test_a_step_from_a_singular_start_is_halved(monkeypatch):
    lengths = []
    monkeypatch.setattr(singularity_step, "_start", lambda project, here, h: lengths.append(h))
    here = SimpleNamespace(t=0.0, y=np.zeros(3), state=lambda t, y: None)
    assert singularity_step.away(None, None, here, 1.0) is None
    assert len(lengths) == 30


@pytest.mark.parametrize(("angle", "places"), [(0.02, 5), (0.05, 1)])
def test_all_distances_are_tried_from_close_by(angle, places, monkeypatch):
    tried = []
    monkeypatch.setattr(singularity_step, "_placed", lambda *given: tried.append(given[-1]))
    monkeypatch.setattr(singularity_step, "_others", lambda *_: None)
    here = SimpleNamespace(t=0.0, y=NOTHING, state=lambda t, y: None)
    assert singularity_step.across(None, None, here, Prediction(1.0, 1, angle=angle)) is None
    assert len(tried) == places
    assert tried[0] == 0.5
    assert max(tried) < 1


@pytest.mark.parametrize(
    ("delta", "off", "agree"),
    [
        (1.0, 3e-14, True),
        (1.0, 3e-13, False),
        (1e-2, 1e-11, True),
        (1e-2, 1e-10, False),
        (1e-4, 3e-10, True),
        (1e-4, 3e-9, False),
    ],
)
def test_steps_agree_to_amplified_rounding(delta, off, agree, monkeypatch):
    monkeypatch.setattr(singularity_step.collocation, "projected", lambda *_: None)
    monkeypatch.setattr(singularity_step.collocation, "sizes_of", lambda found: np.ones(3))
    steps = tuple(
        SimpleNamespace(t=0.0, h=1.0, y=np.zeros(3), state=lambda x, q=q: np.array([q, 0.0, 0.0]))
        for q in (0.0, off)
    )
    project = SimpleNamespace(results=[None] * 4)
    assert singularity_step._agree(project, steps, np.zeros(6), delta) is agree


class Roots:
    """The root of the smallest angle as a function of the time; `times` are those asked for."""

    def __init__(self, root):
        self.root, self.times = root, []

    def __call__(self, at):
        self.times.append(at)
        return self.root(at)


def test_the_instant_is_read_closer_and_closer():
    roots = Roots(abs)
    singularity_step._instant(roots, 0.0, 1.0)
    away = np.abs(roots.times)
    assert away.max() == pytest.approx(0.3)
    assert away.min() == pytest.approx(0.001)
    assert len(away) == 12


@pytest.mark.parametrize(("bend", "is_found"), [(0.03, True), (0.5, False)])
def test_the_smallest_angle_is_a_line_through_zero(bend, is_found):
    found = singularity_step._instant(lambda t: abs(t) * (1 + bend * (abs(t) > 0.03)), 0.0, 1.0)
    assert (found is not None) is is_found


@pytest.mark.parametrize(("at", "is_alone"), [(0.01, True), (0.4, False), (0.99, True), (1.4, False)])
def test_the_smallest_angle_falls_all_the_way(at, is_alone):
    # A second zero is seen where it is looked for.
    def root(t):
        return abs(1 - t) if abs(t - at) > 0.005 else 0.0

    assert singularity_step._is_only_one(root, SimpleNamespace(t=0.0, h=2.0), 1.0) is is_alone


@pytest.mark.parametrize(("off", "is_along"), [(3e-6, True), (3e-5, False)])
def test_a_step_from_a_singular_start_has_its_velocities(off, is_along, monkeypatch):
    step = SimpleNamespace(state=lambda x: np.zeros(3), slope=lambda x: np.array([1.0 + off, 0, 0]))
    monkeypatch.setattr(singularity_step, "_start", lambda *_: step)
    monkeypatch.setattr(singularity_step, "loss", lambda *_: "loss")
    state = State(0.0, np.zeros(1), np.ones(1), NOTHING)
    here = SimpleNamespace(t=0.0, y=np.zeros(3), state=lambda t, y: state, tolerance=np.zeros(6))
    numeric = SimpleNamespace(sizes=lambda *_: ca.DM([1, 1, 1, 1]))
    found = singularity_step.away(numeric, None, here, 1.0)
    assert (found is not None) is is_along


# Rows beside such an instant


@pytest.mark.parametrize(("tau", "lines"), [(0.03, 8), (0.3, 1)])
def test_lines_close_to_the_instant_are_read_off_others(tau, lines):
    asked = []
    rows = SimpleNamespace(line=np.ones(20), at=np.zeros(1), put=lambda t, y: asked.append(t))
    step = SimpleNamespace(t=0.0, h=1.0, state=lambda x: None)
    across = SimpleNamespace(step=step, instant=0.0, width=1.0, is_start=False)
    interpolate_rows.put_in_singular_step(
        SimpleNamespace(trial=SimpleNamespace(rows=rows), origin=0.0), across, tau
    )
    assert len(asked) == lines


@pytest.mark.parametrize(("is_start", "window", "error"), [(False, 0.05, 1e-11), (True, 0.02, 1e-12)])
def test_a_line_at_the_instant_is_known_to_eleven_digits(is_start, window, error):
    taus = interpolate_rows.beside(1.0, is_start)
    assert np.abs(taus).min() >= window
    found = interpolate_rows.interpolated(taus, np.cos(taus)[:, None], 0.0)
    assert found[0] == pytest.approx(1.0, abs=error)


TAUS = interpolate_rows.beside(1.0, False)


def at_instant(*columns, tau=0.0):
    return interpolate_rows.interpolated(TAUS, np.array(columns).T, tau)


@pytest.mark.parametrize(("part", "has_pole"), [(1e-7, False), (1e-6, True)])
def test_a_column_has_a_pole_where_its_moment_does_not_vanish(part, has_pole):
    assert math.isnan(at_instant(1.0 + part / TAUS)[0]) is has_pole


@pytest.mark.parametrize(("part", "has_pole"), [(3e-9, False), (3e-8, True)])
def test_a_pole_that_is_rounding_beside_another_is_none(part, has_pole):
    assert math.isnan(at_instant(1 / TAUS, part / TAUS)[1]) is has_pole


@pytest.mark.parametrize(("tau", "has_value"), [(1e-7, False), (1e-6, True)])
def test_a_column_has_no_value_on_its_pole(tau, has_value):
    assert math.isfinite(at_instant(1 / TAUS, tau=tau)[0]) is has_value


def kink(size):
    """|tau| of such a size that the interpolations of eight lines and of six differ by `size` at the instant."""
    near = np.abs(TAUS) < 0.3
    six = interpolate_rows._lagrange(TAUS[near], np.abs(TAUS)[near, None], 0.0)
    return np.abs(TAUS) * size / abs(interpolate_rows._lagrange(TAUS, np.abs(TAUS)[:, None], 0.0) - six)[0]


@pytest.mark.parametrize(
    ("column", "largest", "is_smooth"),
    [
        (0.5 * TAUS / 0.3 + kink(3e-4), 0.0, True),
        (0.5 * TAUS / 0.3 + kink(3e-3), 0.0, False),
        (1.0 + kink(3e-8), 0.0, True),
        (1.0 + kink(3e-7), 0.0, False),
        (kink(3e-9), 1.0, True),
        (kink(3e-8), 1.0, False),
    ],
    ids=["range", "beyond range", "column", "beyond column", "others", "beyond others"],
)
def test_a_column_that_is_not_smooth_has_no_value(column, largest, is_smooth):
    found = at_instant(column, np.full(TAUS.size, largest))
    assert math.isfinite(found[0]) is is_smooth


@pytest.mark.parametrize(
    ("inner", "outer", "has_limit"), [(0.7, 1, True), (0.8, 1, False), (3e-7, 0, True), (3e-6, 0, False)]
)
def test_a_limit_is_where_differences_shrink(inner, outer, has_limit):
    lines = np.array([[1.0], [1.0], [1.0 + inner], [1.0 + outer]])
    if not outer:
        lines[1:3, 0] = 1.0 - inner, 1.0 + inner
    assert math.isfinite(interpolate_rows.between(lines)[0]) is has_limit


# Why a run cannot go on


def sides(*values, rounding=0.0):
    return Sides(tuple(np.array([float(x)]) for x in values), np.array([rounding]))


def along(f, q=1.0, duration=1.0, reach=1.0):
    """The sides of a function of the way from a place."""
    places = stop_diagnosis._along(State(0.0, np.array([q]), np.ones(1), NOTHING), reach, duration)
    return sides(*(f(place.t) for place in places))


@pytest.mark.parametrize(
    ("q", "duration", "edge", "is_seen"),
    [(1.0, 1.0, 3e-9, True), (1.0, 1.0, 3e-8, False), (0.0, 1.0, 3e-12, True), (0.0, 1.0, 3e-11, False)],
)
def test_a_jump_is_seen_within_rounding_of_the_point(q, duration, edge, is_seen):
    assert bool(along(lambda t: float(t > edge), q, duration).jumps()[0]) is is_seen


@pytest.mark.parametrize(("edge", "is_seen"), [(3e-6, True), (3e-5, False)])
def test_the_end_of_a_function_is_seen_from_farther_off(edge, is_seen):
    assert bool(along(lambda t: 1.0 if t < edge else math.nan).ends()[0]) is is_seen


@pytest.mark.parametrize(("edge", "is_seen"), [(0.03, True), (0.3, False)])
def test_the_end_of_a_row_is_looked_for_a_tenth_ahead(edge, is_seen, monkeypatch):
    monkeypatch.setattr(
        stop_diagnosis, "_rows", lambda numeric, place: np.array([1.0 if place.t < edge else math.nan])
    )
    monkeypatch.setattr(stop_diagnosis, "_rounding", lambda *_: np.zeros(1))
    monkeypatch.setattr(stop_diagnosis, "_call", lambda *_: "")
    monkeypatch.setattr(stop_diagnosis, "time_scale", lambda *_: 1.0)
    system = SimpleNamespace(rows=SimpleNamespace(rows=[SimpleNamespace(name="row")]), holonomic_count=1)
    found = stop_diagnosis.reason(system, None, State(0.0, np.ones(1), np.ones(1), NOTHING))
    assert ("`row` is not defined beyond" in found) is is_seen


@pytest.mark.parametrize(("size", "jumps"), [(3e-10, False), (3e-9, True)])
def test_rounding_of_a_surface_is_no_jump(size, jumps):
    numeric = SimpleNamespace(
        rows=lambda *_: (ca.DM([[1.0]]), None), holonomic=SimpleNamespace(size1_out=lambda _: 1)
    )
    floor = stop_diagnosis._rounding(numeric, State(0.0, np.ones(1), np.ones(1), NOTHING))
    assert bool(sides(0, 0, size, size, rounding=floor[0]).jumps()[0]) is jumps


# The repeated run


def repeated(rtol, atol=None):
    return step_tolerance.of_steps(error_estimate.repeated(settings(rtol, atol)))[:2].tolist()


def test_a_repeated_run_has_a_smaller_tolerance():
    assert repeated(1e-6)[0] == relatively(4e-11)  # 1e-8 / 250
    assert repeated(1e-11)[0] == relatively(3e-15)


def test_the_absolute_tolerance_of_the_repeated_run_is_above_rounding():
    assert repeated(1e-6, 1e-13)[1] == relatively(1e-16)


def test_a_fine_run_is_repeated_with_more_error():
    assert repeated(8e-15)[0] == relatively(2.4e-14)
    assert repeated(9.5e-15)[0] == relatively(3e-15)


@pytest.mark.parametrize(("rtol", "factor"), [(1e-10, 1.0), (3e-11, 1.5), (3e-15, 3.0)])
def test_the_distance_of_runs_counts_more_near_rounding(rtol, factor):
    assert error_estimate.safety(settings(rtol)) == factor


def test_no_estimate_is_below_thirteen_digits():
    errors = error_estimate.Errors(([1],), 1.0)
    row = np.array([[0.0, 2.0]])
    assert errors.take(row, row)[0, 0] == relatively(2e-13)


def test_a_repeated_run_begins_shorter(monkeypatch):
    begins = []

    def start(begin, rows):
        begins.append(begin)
        return SimpleNamespace(blocks=lambda: iter(()))

    monkeypatch.setattr(reference_run.loop, "start", start)
    monkeypatch.setattr(error_estimate, "columns_of_kinds", lambda system: ([], [], [], []))
    enforced = SimpleNamespace(has_time=False, system=SimpleNamespace(columns=()))
    begin = RunStart(enforced, np.zeros(1), np.zeros(1), settings(1e-9))
    reference_run.RunWithReference(SimpleNamespace(grid=SimpleNamespace(count=1)), begin)
    assert begins[0].part == pytest.approx(0.45 * begin.part)


# The first steps of a run


def test_steps_grow_by_ten_at_once():
    particle = "lagcli: 1\nparticles: {a: {mass: 1, position: [1, 0, 0]}}\n"
    run = lagcli.simulate(lagcli.loads(particle), duration=1.0, samples=2)
    assert run.stats.steps == 7  # 1e-6 of a second, and each next one ten times as long


def a_run(angle):
    """A run at its start, of rows at an angle."""
    y = np.zeros(3)
    found = np.array([0.0, angle**2, 1.0]), np.ones(4)
    return SimpleNamespace(
        bound=SimpleNamespace(put_on_constraints=lambda: found, y=y, k=y.copy(), rhs=None),
        control=SimpleNamespace(step=0.0),
        count=lambda evaluations: None,
        tolerance=np.zeros(6),
        method=SimpleNamespace(order=8),
        watch=SingularityMonitor(),
        t=0.0,
        settle=lambda: None,
    )


@pytest.mark.parametrize(("angle", "is_looked_at"), [(0.03, True), (0.3, False)])
def test_close_rows_of_a_start_are_looked_at_before_it(angle, is_looked_at, monkeypatch):
    looks = []
    monkeypatch.setattr(loop.controller, "first_step", lambda *_: 1.0)
    run = a_run(angle)
    run.bound.projected_at = lambda t, y: looks.append(run.t - t) or (y, y, np.ones(3))
    loop._begin(run, RunStart(None, np.zeros(1), np.zeros(1), settings(1e-9)))
    assert looks == ([pytest.approx(0.1 * run.control.step)] if is_looked_at else [])


@pytest.mark.parametrize(("angle", "is_asked"), [(0.03, False), (0.3, True)])
def test_close_rows_are_searched_at_once(angle, is_asked, monkeypatch):
    asked = []
    monkeypatch.setattr(SingularEvent, "_is_dip", lambda event: asked.append(event) or True)
    monkeypatch.setattr(SingularEvent, "_point", None, raising=False)
    monkeypatch.setattr(singularity_step, "across", lambda *_: None)
    run = SimpleNamespace(
        watch=SingularityMonitor((), Prediction(0.1, 1, angle=angle)),
        t=0.0,
        control=SimpleNamespace(step=1.0),
        tolerance=(1e-6,),
        method=SimpleNamespace(order=8),
        bound=SimpleNamespace(numeric=None, scratch=None, enforced=SimpleNamespace(is_any=False)),
        trial=SimpleNamespace(count_scratch=lambda: None),
    )
    event = SingularEvent.__new__(SingularEvent)
    event._stepper = run
    assert not event.passes()
    assert bool(asked) is is_asked
