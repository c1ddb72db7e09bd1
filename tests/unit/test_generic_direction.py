"""The direction that belongs to no model."""

import numpy as np
import pytest

from lagcli.linear import generic_direction


@pytest.mark.parametrize("seed", [0, 20061, 7])
def test_written_out_or_drawn_the_numbers_are_those_of_the_generator(seed):
    drawn = np.random.default_rng(seed).standard_normal(200)
    for n in (0, 1, 3, 17, 18, 19, 200):
        assert (generic_direction.direction(n, seed) == drawn[:n]).all()


@pytest.mark.parametrize("n", [0, 1, 3, 17, 18, 19, 200])
def test_signs_are_those_that_the_generator_chooses(n):
    drawn = np.random.default_rng(0).choice((-1.0, 1.0), size=n)
    assert (generic_direction.signs(n) == drawn).all()


def test_a_direction_may_be_changed_by_who_has_it():
    first = generic_direction.direction(3, 0)
    first[:] = 0.0
    assert generic_direction.direction(3, 0).all()
