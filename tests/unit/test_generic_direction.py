"""The direction that belongs to no model."""

import numpy as np
import pytest

from lagcli.linear import decompositions


@pytest.mark.parametrize("seed", [0, 20061, 7])
def test_a_direction_is_evenly_distributed_and_begins_alike_whatever_its_length(seed):
    found = decompositions.generic_direction(2000, seed)
    assert (decompositions.generic_direction(3, seed) == found[:3]).all()
    assert np.mean(found**2) == pytest.approx(1.0, rel=0.1)
    assert np.abs(found).min() > 1e-6
    sums = np.abs(np.fft.rfft(found)) / np.sqrt(2000)  # no period stands out
    assert sums.max() < 4.0


def test_directions_of_other_seeds_are_others():
    one, other = (decompositions.generic_direction(2000, seed) for seed in (0, 1))
    assert abs(one @ other) / 2000 < 0.1


@pytest.mark.parametrize("n", [0, 1, 3, 17, 18, 19, 200])
def test_signs_are_those_that_the_generator_chooses(n):
    drawn = np.random.default_rng(0).choice((-1.0, 1.0), size=n)
    assert (decompositions.generic_signs(n) == drawn).all()


def test_a_direction_may_be_changed_by_who_has_it():
    first = decompositions.generic_direction(3, 0)
    first[:] = 0.0
    assert decompositions.generic_direction(3, 0).all()
