"""Dependent rows: independent ones are found, motion and R stay, and lambda is split by a rule and told."""

import itertools
import re

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lagcli
from lagcli.api import prepare_run
from lagcli.compiled import selection
from lagcli.compiled.selection import Selection
from lagcli.linear import independent_rows
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import MetricRows
from lagcli.simulation.run_state import run_stop

pytestmark = pytest.mark.numeric

HEAD = """
lagcli: 1
particles:
  a: {mass: 2, position: [3, 4, 0]}
forces: {weight: {to: a, force: [0, -m*g, 0]}}
parameters: {g: 10}
simulation: {duration: 2, samples: 21, rtol: 1.0e-11, atol: 1.0e-11}
holonomic:
  plane: a.z = 0
"""
ROD = "  rod: distance(a, [0, 0, 0]) = 5\n"


def simulated(text, **wishes):
    return lagcli.simulate(lagcli.loads(text), **wishes)


def ended(text):
    """A run after its last row."""
    model = lagcli.loads(text)
    running = prepare_run.start(model, model.simulation)
    list(running.blocks())
    return running


def columns(run, start):
    return np.array([run[c] for c in run.columns if c.startswith(start)])


# Independent rows and dependencies.


@st.composite
def dependent_rows(draw):
    """Small integer rows (C, n), some of which are combinations of others."""
    n, count = draw(st.integers(2, 6)), draw(st.integers(1, 5))
    numbers = st.integers(-3, 3)
    rows = [draw(st.lists(numbers, min_size=n, max_size=n)) for _ in range(count)]
    for _ in range(draw(st.integers(0, 3))):
        weights = draw(st.lists(numbers, min_size=count, max_size=count))
        rows.append([sum(w * row[k] for w, row in zip(weights, rows, strict=False)) for k in range(n)])
    return np.array(draw(st.permutations([row for row in rows if any(row)] or [[1] * n])), dtype=float)


def rank_of(B):
    """The rank also of no rows, which NumPy 1.26 has no maximum of."""
    return int(np.linalg.matrix_rank(B)) if len(B) else 0


def chosen(B, masses=None):
    n = B.shape[1]
    metric = Metric(ca.DM(np.diag(np.ones(n) if masses is None else masses)))
    rows = MetricRows(ca.sparsify(ca.DM(B)), metric)
    return independent_rows.dependence(rows, int(np.linalg.matrix_rank(B)))


@settings(max_examples=150, deadline=None)
@given(dependent_rows())
def test_dependencies_are_minimal_and_the_other_rows_independent(B):
    found = chosen(B).selection
    assert found.count == len(B)
    assert (
        np.linalg.matrix_rank(B[list(found.independent)])
        == len(found.independent)
        == np.linalg.matrix_rank(B)
    )
    for dependency in found.dependencies:
        assert dependency[0] not in found.independent
        assert set(dependency[1:]) <= set(found.independent)
        whole = B[list(dependency)]
        assert np.linalg.matrix_rank(whole) == len(dependency) - 1
        for left_out in range(len(dependency)):
            rest = np.delete(whole, left_out, axis=0)
            assert np.linalg.matrix_rank(rest) == len(rest)
    # A multiplier is unique exactly where its row is independent of all the others.
    unique = {i for i in range(len(B)) if rank_of(np.delete(B, i, 0)) < rank_of(B)}
    assert found.indeterminate == set(range(len(B))) - unique


@settings(max_examples=60, deadline=None)
@given(dependent_rows(), st.integers(0, 10**6), st.sampled_from((0, selection.WRITTEN_OUT)))
def test_multipliers_are_those_of_the_weighted_least_squares(B, seed, written_out):
    """Of all lambda with the same B^T lambda the least sum of lambda_i^2 B_i M^-1 B_i^T, by the pseudo-inverse."""
    random = np.random.default_rng(seed)
    masses = random.uniform(0.5, 4, B.shape[1])
    found = chosen(B, masses).selection
    lam = random.standard_normal(len(found.independent))
    S = B @ np.diag(1 / masses) @ B.T
    shared = list(found.shared)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(selection, "WRITTEN_OUT", written_out)
        split = selection.split(found, ca.MX(ca.DM(S[np.ix_(shared, shared)])), ca.MX(ca.DM(lam)))
        split = np.array(ca.evalf(split)).ravel()
    lengths = np.sqrt(np.diag(S))
    R = B[list(found.independent)].T @ lam
    expected = np.linalg.pinv((B / lengths[:, None]).T, rcond=1e-9) @ R / lengths
    np.testing.assert_allclose(split, expected, rtol=0, atol=1e-8 * max(1, np.abs(expected).max()))


def test_groups_are_circuits_that_share_rows():
    found = Selection((0, 1, 2, 5, 6), ((3, 0, 1), (4, 1, 2), (7, 5), (8,)))
    assert sorted(found.groups()) == [([3, 4], [0, 1, 2]), ([7], [5])]
    assert found.indeterminate == {0, 1, 2, 3, 4, 5, 7, 8}
    assert found.shared == (0, 1, 2, 3, 4, 5, 7, 8)


def test_other_rows_are_chosen_of_the_same_sets():
    found = Selection((0, 1, 2, 5, 6), ((3, 0, 1), (4, 1, 2), (7, 5), (8,)))
    other = independent_rows.rebased(found, (2, 3, 4, 6, 7))
    assert other == Selection((2, 3, 4, 6, 7), ((0, 2, 3, 4), (1, 2, 3, 4), (5, 7), (8,)))
    assert other.indeterminate == found.indeterminate
    assert independent_rows.rebased(found, (2, 3, 5, 6, 7)) is None  # two of three, and two of one
    assert independent_rows.rebased(found, (0, 1, 2, 5, 8)) is None


# A run.

WRITTEN = [
    "distance(a, [0, 0, 0]) = 5",
    "5 = norm(a)",
    "dot(a, a) = 25",
    "100*dot(a, a) - 2500",
    "a.x**2/7 + a.y**2/7 + a.z**2/7 = 25/7",
    "sqrt(dot(a, a)) - 5",
]


@pytest.mark.parametrize(("one", "other"), [*itertools.combinations(WRITTEN, 2)])
def test_twin_rods_share_one_force_equally_however_they_are_written(one, other):
    independent = simulated(HEAD + ROD)
    run = simulated(HEAD + f"  rod: '{one}'\n  twin: '{other}'\n")
    for start in ("a.", "R."):
        np.testing.assert_allclose(columns(run, start), columns(independent, start), rtol=0, atol=1e-9)
    # The part of R that each bears: lambda_i B_i, B_i along the rod.
    shares = []
    for name, text in (("rod", one), ("twin", other)):
        length = {True: 1.0, False: 10.0}["distance" in text or "norm" in text or "sqrt" in text]
        length *= 100 if text.startswith("100") else 1 / 7 if "/7" in text else 1
        shares.append(run[f"lambda.{name}"] * length * (-1 if text.startswith("5") else 1))
    np.testing.assert_allclose(shares[0], shares[1], rtol=1e-9)
    np.testing.assert_allclose(shares[0], independent["lambda.rod"] / 2, rtol=1e-9)
    assert set(run.stats.indeterminate) == {"rod", "twin"}
    assert not np.abs(run["lambda.plane"]).max() > 1e-12


def test_many_copies_each_bear_their_part():
    copies = "".join(f"  copy{k}: 'distance(a, [0, 0, 0]) = 5'\n" for k in range(7))
    independent, run = simulated(HEAD + ROD), simulated(HEAD + ROD + copies)
    for name in ("rod", *(f"copy{k}" for k in range(7))):
        np.testing.assert_allclose(run[f"lambda.{name}"], independent["lambda.rod"] / 8, rtol=1e-9)


def test_what_is_not_unique_is_said_by_name():
    running = ended(HEAD + ROD + "  twin: 'dot(a, a) = 25'\n")
    (note,) = running.notes
    assert "2 multipliers are not unique (`rod` and `twin` share one force)" in note
    assert "R and the motion are" in note
    running = ended(HEAD + ROD)
    assert running.notes == ()
    assert running.stats.indeterminate == ()


SKATES = """
lagcli: 1
parameters: {g: 9.81}
coordinates: {x: {rate: 0.6}, y: {rate: 0.8}, phi: {value: 0.9272952180016122, rate: 0.7}}
lagrangian: (rate(x)**2 + rate(y)**2)/2 + rate(phi)**2/8 - 3*x
simulation: {duration: 2, samples: 21, rtol: 1.0e-11, atol: 1.0e-11}
differential:
  blade: sin(phi)*d(x) - cos(phi)*d(y) = 0
"""


def test_redundant_differential_rows():
    independent = simulated(SKATES)
    more = (
        SKATES
        + "  twin: 3*cos(phi)*d(y) - 3*sin(phi)*d(x) = 0\n  hot: (2 + x**2)*(tan(phi)*d(x) - d(y)) = 0\n"
    )
    run = simulated(more)
    for name in ("x", "y", "phi", "R.x", "R.y"):
        np.testing.assert_allclose(run[name], independent[name], rtol=0, atol=1e-9)
    assert set(run.stats.indeterminate) == {"blade", "twin", "hot"}
    # B_i M^-1 B_i^T of blade is 1: lambda of blade is a third.
    np.testing.assert_allclose(run["lambda.blade"], independent["lambda.blade"] / 3, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(run["lambda.twin"], -independent["lambda.blade"] / 9, rtol=1e-8, atol=1e-10)


def test_a_differential_row_that_follows_from_whole_ones():
    more = HEAD + ROD + "differential: {turn: 'a.x*d(a.x) + a.y*d(a.y) + a.z*d(a.z) = 0'}\n"
    independent, run = simulated(HEAD + ROD), simulated(more)
    np.testing.assert_allclose(columns(run, "R."), columns(independent, "R."), rtol=0, atol=1e-9)
    np.testing.assert_allclose(run["lambda.rod"], independent["lambda.rod"] / 2, rtol=1e-9)
    assert set(run.stats.indeterminate) == {"rod", "turn"}


def test_a_row_that_vanishes_on_the_surface_bears_nothing():
    for text in (
        HEAD + ROD + "  square: a.z**2 = 0\n",
        HEAD.replace("  plane", "  square: a.z**2 = 0\n  plane") + ROD,
    ):
        run = simulated(text)
        assert np.all(run["lambda.square"] == 0)
        assert run.stats.indeterminate == ("square",)
    np.testing.assert_allclose(run["lambda.rod"], simulated(HEAD + ROD)["lambda.rod"], rtol=1e-9)


def test_moving_redundant_rows():
    text = HEAD.replace("position: [3, 4, 0]", "position: [3, 4, 0], velocity: [0.6, 0.8, 0]")
    independent = text + "  rod: distance(a, [0, 0, 0]) = 5 + t\n"
    run = simulated(independent + "  twin: dot(a, a) = (5 + t)**2\n")
    np.testing.assert_allclose(columns(run, "R."), columns(simulated(independent), "R."), rtol=0, atol=1e-8)
    assert set(run.stats.indeterminate) == {"rod", "twin"}


def test_the_choice_of_rows_does_not_depend_on_their_order():
    """K6 in space: 15 rods of rank 12; motion, R and the split are one for every order of the rows."""
    random = np.random.default_rng(6)
    points = random.standard_normal((6, 3))
    lines = ["lagcli: 1", "particles:"]
    velocities = np.cross([0.3, -0.5, 0.8], points)
    for k, (place, speed) in enumerate(zip(points, velocities, strict=True)):
        lines.append(f"  p{k}: {{mass: {1 + k}, position: {place.tolist()}, velocity: {speed.tolist()}}}")
    lines += ["forces: {weight: {to: p0, force: [0, 1, -9.81]}}", "holonomic:"]
    rods = [
        f"  r{i}{j}: distance(p{i}, p{j}) = {float(np.linalg.norm(points[i] - points[j]))!r}"
        for i, j in itertools.combinations(range(6), 2)
    ]
    tail = ["simulation: {duration: 1, samples: 5, rtol: 1.0e-11, atol: 1.0e-11}"]
    first = simulated("\n".join([*lines, *rods, *tail]))
    other = simulated("\n".join([*lines, *random.permutation(rods).tolist(), *tail]))
    assert set(first.stats.indeterminate) == {re.match(r"  (\w+)", rod)[1] for rod in rods}
    for name in first.columns:
        np.testing.assert_allclose(other[name], first[name], rtol=0, atol=2e-8, err_msg=name)


def test_rows_that_part_on_the_way_stop_the_run_by_name():
    """They agree for half of the run; no look ahead from the start shows it."""
    text = HEAD + ROD + "  twin: distance(a, [0, 0, 0]) = 5 + max(0, t - 1)**3\n"
    model = lagcli.loads(text)
    running = prepare_run.start(model, model.simulation)
    blocks = []
    with pytest.raises(
        run_stop.RunStop, match="the rows `rod`, `twin` contradict each other beyond"
    ) as stopped:
        blocks.extend(running.blocks())
    assert 1 <= stopped.value.stop.t < 1.01
    assert np.concatenate(blocks)[-1, 0] == 1
