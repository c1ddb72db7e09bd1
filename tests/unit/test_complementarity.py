"""The least x with G x >= h and its multipliers, against enumeration of all sets of contacts that hold."""

import itertools

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lagcli.contact import complementarity
from lagcli.contact.complementarity import Complementary, ContradictoryRows, UndecidedRows

Floats = npt.NDArray[np.float64]

# A table with four legs at the corners of a square: how far a leg goes down with a fall and two tilts.
LEGS = np.array([[1.0, x, y] for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))])


def check(rows: Floats, bounds: Floats, found: Complementary) -> None:
    """The certificate, to rounding of the terms."""
    lam = found.multipliers
    size = 1e-10 * (np.linalg.norm(rows, axis=1) * np.linalg.norm(found.x) + np.abs(bounds))
    assert (lam >= 0).all()
    assert (rows @ found.x - bounds >= -size).all()
    assert np.abs((rows @ found.x - bounds)[lam > 0] / size[lam > 0]).max(initial=0.0) <= 1
    terms = np.abs(rows).T @ lam
    assert np.abs(rows.T @ lam - found.x).max(initial=0.0) <= 1e-10 * terms.max(initial=1.0)


def enumerated(rows: Floats, bounds: Floats) -> Floats | None:
    """The shortest x with rows x >= bounds, by trying every set of rows that hold; None where there is none."""
    best = None
    for held in itertools.product([False, True], repeat=bounds.size):
        here = np.array(held, dtype=bool)
        x = np.linalg.pinv(rows[here], rcond=1e-10) @ bounds[here]
        if (rows @ x - bounds >= -1e-9 * (1 + np.abs(bounds))).all() and (
            best is None or np.linalg.norm(x) < np.linalg.norm(best)
        ):
            best = x
    return best


def test_no_contact_and_one() -> None:
    found = complementarity.solve(np.zeros((0, 3)), np.zeros(0))
    assert found.x.tolist() == [0, 0, 0]
    found = complementarity.solve(np.array([[3.0, 4.0]]), np.array([10.0]))
    assert found.multipliers == pytest.approx([0.4], rel=1e-15)
    assert found.x == pytest.approx([1.2, 1.6], rel=1e-15)
    assert found.unique.all()
    found = complementarity.solve(np.array([[3.0, 4.0]]), np.array([-10.0]))
    assert found.multipliers.tolist() == [0]
    assert found.slack.tolist() == [10]
    assert not found.holds.any()


def test_four_legs_of_a_table_share_the_load() -> None:
    """The shares are not determined; of all of them the most even is given."""
    found = complementarity.solve(LEGS, np.ones(4))
    assert found.multipliers == pytest.approx([0.25] * 4, rel=1e-14)
    assert not found.unique.any()
    check(LEGS, np.ones(4), found)


def test_legs_of_which_one_does_not_touch_are_unique() -> None:
    bounds = np.array([1.0, 1.0, 0.5, 1.0])
    found = complementarity.solve(LEGS, bounds)
    check(LEGS, bounds, found)
    assert found.unique.all()
    bounds[2] = -9.0
    found = complementarity.solve(LEGS, bounds)
    check(LEGS, bounds, found)
    assert not found.holds[2]
    assert found.unique.all()


def test_the_split_does_not_depend_on_how_rows_are_written() -> None:
    scale = np.array([1.0, 1e6, 1e-3, 7.0])
    one = complementarity.solve(LEGS, np.ones(4)).multipliers
    other = complementarity.solve(scale[:, None] * LEGS, scale).multipliers
    assert other * scale == pytest.approx(one, rel=1e-13)


def test_a_load_over_one_corner_is_shared_by_those_that_can() -> None:
    """A load over leg 0 needs no other leg, and leg 2 could only take part with the pulls of others."""
    rows = np.vstack([LEGS, [[1.0, 0.0, 0.0]]])
    force = np.array([1.0, 1.0, 1.0])
    bounds = np.concatenate([LEGS @ force, [force[0] - 1.0]])
    found = complementarity.solve(rows, bounds)
    check(rows, bounds, found)
    weights = np.array([0.5, 0.25, 0.0, 0.25])
    bounds = LEGS @ (LEGS.T @ weights)
    found = complementarity.solve(LEGS, bounds)
    check(LEGS, bounds, found)
    assert not found.unique.any()
    one_alone = complementarity.solve(LEGS, LEGS @ LEGS[0])
    assert one_alone.multipliers == pytest.approx([1, 0, 0, 0], abs=1e-14)
    assert one_alone.unique.all()


def test_the_same_wall_twice() -> None:
    rows = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 2.0]])
    found = complementarity.solve(rows, np.array([2.0, 2.0, 3.0]))
    assert found.multipliers == pytest.approx([1, 1, 0.75], rel=1e-14)
    assert found.unique.tolist() == [False, False, True]
    lower = complementarity.solve(rows, np.array([2.0, 1.0, 3.0]))
    assert lower.multipliers == pytest.approx([2, 0, 0.75], rel=1e-14)
    assert lower.unique.all()


def test_two_walls_that_close_are_contradictory() -> None:
    rows = np.array([[0.0, 1.0], [1.0, 0.0], [-1.0, 0.0]])
    with pytest.raises(ContradictoryRows) as error:
        complementarity.solve(rows, np.array([1.0, 1.0, 1.0]))
    assert error.value.rows == (1, 2)
    found = complementarity.solve(rows, np.array([1.0, 1.0, -1.0]))
    assert found.x == pytest.approx([1, 1], rel=1e-14)
    # The wall behind can push too, against the one in front, as hard as one likes.
    assert found.unique.tolist() == [True, False, False]


def test_rows_of_zeros() -> None:
    rows = np.array([[0.0, 0.0], [1.0, 0.0]])
    found = complementarity.solve(rows, np.array([-1.0, 2.0]))
    assert found.multipliers == pytest.approx([0, 2])
    assert found.unique.all()
    found = complementarity.solve(rows, np.array([1e-17, 2.0]), 1e-16)
    assert found.multipliers == pytest.approx([0, 2])
    assert found.unique.tolist() == [False, True]
    with pytest.raises(ContradictoryRows) as error:
        complementarity.solve(rows, np.array([1e-3, 2.0]))
    assert error.value.rows == (0,)


def test_numbers_that_are_none_are_refused() -> None:
    with pytest.raises(UndecidedRows):
        complementarity.solve(np.array([[1.0, np.nan]]), np.ones(1))
    with pytest.raises(UndecidedRows):
        complementarity.solve(np.eye(2), np.array([np.inf, 1.0]))


def test_a_problem_that_scipy_gets_wrong() -> None:
    """`nnls` of 1.15 to 1.17 gives weights here that are far from the best, and says that they fit exactly."""
    rows = np.array([[-1.0, 1, 0], [0, -1, 1], [1, 1, 0], [-1, 1, -1], [0, 0, 1]])
    bounds = rows @ (rows.T @ [0, 0, 1, 2, 0])
    found = complementarity.solve(rows, bounds)
    assert found.multipliers == pytest.approx([0, 0, 1, 2, 0], abs=1e-13)
    check(rows, bounds, found)


@pytest.mark.parametrize("size", [1e-12, 1.0, 1e12])
def test_a_long_chain_of_contacts(size: float) -> None:
    """200 spheres in a row, pushed together at both ends: every contact holds and carries the same."""
    count = 200
    rows = np.zeros((count, 3 * (count + 1)))
    for i in range(count):
        rows[i, 3 * i], rows[i, 3 * i + 3] = -1.0, 1.0
    push = np.zeros(3 * (count + 1))
    push[0], push[-3] = size, -size
    bounds = -rows @ push
    found = complementarity.solve(rows, bounds, 1e-16 * size)
    check(rows, bounds, found)
    # All go at one speed afterwards, here at none: the push goes through the row.
    assert found.multipliers == pytest.approx(np.full(count, size), rel=1e-9)
    assert found.unique.all()


def test_the_chain_of_whole_numbers_against_its_closed_form() -> None:
    """Random pushes along a chain: the multipliers that hold are the least concave majorant of what is pushed."""
    random = np.random.default_rng(3)
    rows = np.eye(60, 61, 1) - np.eye(60, 61)
    velocity = random.standard_normal(61)
    found = complementarity.solve(rows, -rows @ velocity)
    after = velocity + found.x
    # Velocities after plastic blows are the isotonic regression of those before.
    pooled: list[list[float]] = []
    for v in velocity:
        pooled.append([v, 1.0])
        while len(pooled) > 1 and pooled[-2][0] >= pooled[-1][0]:
            last, width = pooled.pop()
            v0, w0 = pooled[-1]
            pooled[-1] = [(v0 * w0 + last * width) / (w0 + width), w0 + width]
    expected = np.concatenate([[v] * int(width) for v, width in pooled])
    assert after == pytest.approx(expected, abs=1e-13)


@given(st.integers(0, 10**7), st.integers(1, 5), st.integers(1, 4), st.booleans())
@settings(max_examples=200, deadline=None)
def test_against_all_sets_of_rows_that_may_hold(seed: int, count: int, n: int, is_whole: bool) -> None:
    """Whole numbers make rows that are dependent, opposite, equal or zero, and bounds that just hold."""
    random = np.random.default_rng(seed)
    rows = (
        random.integers(-1, 2, (count, n)).astype(float) if is_whole else random.standard_normal((count, n))
    )
    bounds = random.integers(-2, 3, count).astype(float) if is_whole else random.standard_normal(count)
    expected = enumerated(rows, bounds)
    try:
        found = complementarity.solve(rows, bounds)
    except ContradictoryRows as error:
        assert expected is None
        together = list(error.rows)
        with pytest.raises(ContradictoryRows):
            complementarity.solve(rows[together], bounds[together])
        return
    assert expected is not None
    assert found.x == pytest.approx(expected, abs=1e-9)
    check(rows, bounds, found)


@given(st.integers(0, 10**7), st.integers(2, 6), st.integers(1, 3))
@settings(max_examples=100, deadline=None)
def test_flags_and_shares_of_dependent_rows(seed: int, count: int, n: int) -> None:
    """Every solution that is found by chance is no better, and agrees where a multiplier is said to be unique."""
    from scipy import optimize

    random = np.random.default_rng(seed)
    rows = random.integers(-1, 2, (count, n)).astype(float)
    rows = rows[np.abs(rows).any(axis=1)]
    load = np.maximum(random.integers(-1, 3, len(rows)), 0).astype(float)
    x = rows.T @ load
    found = complementarity.solve(rows, rows @ x)
    check(rows, rows @ x, found)
    assert found.x == pytest.approx(x, abs=1e-12)
    lengths = np.linalg.norm(rows, axis=1)
    best = float(((found.multipliers * lengths) ** 2).sum())
    assert best <= float(((load * lengths) ** 2).sum()) + 1e-9
    low, high = np.zeros(len(rows)), np.zeros(len(rows))
    for i in range(len(rows)):
        cost = np.eye(len(rows))[i]
        limit = [(0, 100)] * len(rows)
        low[i] = optimize.linprog(cost, A_eq=rows.T, b_eq=x, bounds=limit).fun
        high[i] = -optimize.linprog(-cost, A_eq=rows.T, b_eq=x, bounds=limit).fun
    assert found.unique.tolist() == (high - low < 1e-6).tolist()
