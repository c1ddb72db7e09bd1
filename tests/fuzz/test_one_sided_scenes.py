"""Random one-sided models: each leg and each impact is right; more of them by `python -m tests.fuzz.one_sided`."""

from __future__ import annotations

import pytest

from tests.fuzz.one_sided import audited, chain_verdict, judged
from tests.helpers import chain_models, one_sided_models

# The last ones: spheres that turn round at each other between two places of a step, a rebound too slow to be one, an
# impact between the last rebound of a series and its end, impacts that are 3e-7 apart; a contact that creeps in as
# slowly as what falls over, a gap of 3e-11 that is not closed, speeds of 1e-6 that are dropped, energy
# made of rounding; a rope that is taut by rounding alone.
SCENES = (*range(16), 708, 698, 505, 603, 150, 21, 109, 335, 902, 798)
# A contact at rest that another one's impact lifts by less than can be followed, without a rebound of its own; one that
# is open and not struck before the next incident; series of rebounds that another impact cuts off, one within another.
CHAINS = (53, 306, 162, 330)


@pytest.mark.parametrize("seed", SCENES)
def test_no_contact_is_missed_entered_or_pulls_and_every_impact_obeys_the_law(seed: int) -> None:
    verdict = judged(one_sided_models.scene(seed))
    assert verdict.outcome == "done"
    assert verdict.faults == []


@pytest.mark.parametrize("seed", CHAINS)
def test_chains_between_moving_walls_pass_their_own_audit(seed: int) -> None:
    assert audited(chain_models.chain(seed)) == []


def test_a_chain_is_judged_leg_by_leg_and_by_its_audit() -> None:
    verdict = chain_verdict(2)
    assert (verdict.outcome, verdict.faults, verdict.impacts) == ("done", [], 8)
