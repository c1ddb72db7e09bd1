"""Random one-sided models: each leg and each impact is right; more of them by `python -m tests.fuzz.one_sided`."""

from __future__ import annotations

import pytest

from tests.fuzz.one_sided import judged
from tests.helpers import one_sided_models

# The last ones: spheres that turn round at each other between two places of a step, a rebound too slow to be one, an
# impact between the last rebound of a series and its end, impacts that are 3e-7 apart; a contact that creeps in as
# slowly as what falls over, a gap of 3e-11 that is not closed, speeds of 1e-6 that are dropped, energy
# made of rounding.
SCENES = (*range(16), 708, 698, 505, 603, 150, 21, 109, 335, 902)


@pytest.mark.parametrize("seed", SCENES)
def test_no_contact_is_missed_entered_or_pulls_and_every_impact_obeys_the_law(seed: int) -> None:
    verdict = judged(one_sided_models.scene(seed))
    assert verdict.outcome == "done"
    assert verdict.faults == []
