"""A slice of random differential systems with known verdicts; more by LAGCLI_FUZZ_EXAMPLES."""

import os

import pytest

import lagcli
from tests.helpers import pfaffian_systems

EXAMPLES = int(os.environ.get("LAGCLI_FUZZ_EXAMPLES", "0")) or 12


@pytest.mark.parametrize("seed", range(EXAMPLES))
def test_the_count_of_a_hidden_normal_form_is_known(seed: int) -> None:
    text, truth = pfaffian_systems.system(seed)
    found = lagcli.dof(lagcli.loads(text))
    low, high = found.bounds
    assert low <= truth <= high
    assert found.configuration_dof in (truth, None)
    assert (
        found.configuration_dof == truth or EXAMPLES > 12
    )  # undecided ones are rare, and none is in the slice
