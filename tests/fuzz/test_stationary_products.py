"""A slice of `tests.fuzz.stationary_products`, which finds all of what is known."""

import pytest

import lagcli
from tests.fuzz import stationary_products
from tests.helpers import statics_models


@pytest.mark.parametrize("inexact", [False, True])
def test_all_points_of_products_are_found_and_none_is_false(inexact: bool) -> None:
    tally = stationary_products.Tally()
    for seed in (1, 3, 4):
        stationary_products.judge(seed, tally, inexact, starts=8)
    assert tally.found == tally.wanted > 10
    assert tally.false == tally.wrong_proofs == 0
    assert tally.proved == (0 if inexact else 3)


@pytest.mark.parametrize("seed", [0, 1, 3, 4, 5, 6, 7, 7107])
def test_points_of_polynomials_are_those_of_an_exact_count(seed: int) -> None:
    assert stationary_products.judge_polynomial(seed, starts=0) == ([], True)


@pytest.mark.parametrize("seed", range(2))
def test_lambda_and_R_at_rest_are_those_of_a_run(seed: int) -> None:
    assert stationary_products.judge_mechanism(seed) == []


def test_mechanisms_of_every_kind_are_models() -> None:
    texts = [statics_models.mechanism(seed) for seed in range(20)]
    for part in ("l1:", "other:", "coordinates:", "inequality:", "s2:"):
        assert any(part in text for text in texts)
    for text in texts:
        assert lagcli.loads(text).coordinate_names
