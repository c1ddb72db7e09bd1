"""Arguments of another size than a compiled function takes are refused: parameters of another system above all."""

import casadi as ca
import numpy as np
import pytest

from lagcli.compiled.bound_function import BoundFunction
from lagcli.compiled.paths import ROUGH, PathSteps
from lagcli.smoothness.sized_function import SizedFunction


def scaled(count):
    """scaled(t, q, p) -> t q (2,) and p (count,)."""
    t, q, p = ca.SX.sym("t"), ca.SX.sym("q", 2), ca.SX.sym("p", count)
    return SizedFunction("scaled", [t, q, p], [ca.densify(t * q), p])


@pytest.mark.parametrize("count", [0, 1, 3])
@pytest.mark.parametrize("given", [0, 1, 2, 3, 4])
def test_a_call_takes_as_many_parameters_as_the_function_has(count, given):
    p, q = np.arange(1.0, given + 1), np.array([1.0, 2.0])
    kinds = [p, list(p), ca.DM(p), ca.SX(ca.DM(p)), ca.MX(ca.DM(p))]
    for each in kinds:
        if given == count:
            assert scaled(count)(2.0, q, each)[1].shape[0] == count
        else:
            with pytest.raises(AssertionError, match=r"'scaled', 2"):
                scaled(count)(2.0, q, each)


def test_a_number_is_no_vector_and_a_row_is_no_column():
    for q in (1.0, np.float64(1.0), np.array(1.0), np.ones((1, 2)), []):
        with pytest.raises(AssertionError, match=r"'scaled', 1"):
            scaled(1)(2.0, q, 3.0)


def test_more_columns_are_more_points():
    moved, _ = scaled(1)(np.array([[1.0, 2.0]]), np.ones((2, 2)), 3.0)
    assert np.array_equal(np.array(moved), [[1.0, 2.0], [1.0, 2.0]])


@pytest.mark.parametrize("sizes", [(1, 2, 1), (1, 2, 0), (1, 1, 3), (1, 2), ()])
def test_bound_arrays_have_the_sizes_of_the_arguments(sizes):
    with pytest.raises(AssertionError, match="scaled"):
        BoundFunction(scaled(3), [np.zeros(size) for size in sizes])


def test_arrays_for_results_have_their_sizes():
    with pytest.raises(AssertionError, match="scaled"):
        BoundFunction(scaled(3), [np.zeros(size) for size in (1, 2, 3)], given=[np.zeros(1)])


def test_points_of_paths_and_their_controls_have_the_sizes_of_the_field():
    z, u = ca.SX.sym("z", 3), ca.SX.sym("u", 2)
    steps = PathSteps(SizedFunction("field", [z, u], [ca.vertcat(u, 1) * z]), ROUGH)
    assert np.array_equal(steps.rate(np.ones((2, 3)), np.ones((2, 2))), np.ones((2, 3)))
    for points, controls in ((1, 2), (3, 1), (3, 3)):
        with pytest.raises(AssertionError, match=r"field|map"):
            steps.rate(np.ones((2, points)), np.ones((2, controls)))


def test_results_that_are_zero_by_structure_are_written_in_full():
    x = ca.SX.sym("x", 2)
    outputs = [ca.SX(3, 1), ca.vertcat(x[0], ca.SX(1, 1), x[1]), ca.SX(2, 2), x]
    function = SizedFunction("sparse", [x], outputs)
    given = np.full(3, 7.0)
    bound = BoundFunction(function, [np.array([1.0, 2.0])], given=[given])
    bound.trigger()
    zeros, mixed, square, own = bound.results
    assert zeros is given
    assert [zeros.tolist(), mixed.tolist(), own.tolist()] == [[0, 0, 0], [1, 0, 2], [1, 2]]
    assert np.array_equal(square, np.zeros((2, 2)))
    entries = BoundFunction(function, [np.array([1.0, 2.0])], is_sparse=True)
    entries.trigger()
    assert [part.size for part in entries.results] == [0, 2, 0, 2]
