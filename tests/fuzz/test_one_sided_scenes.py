"""Random one-sided models: each leg and each impact is right; more of them by `python -m tests.fuzz.one_sided`."""

from __future__ import annotations

import pytest

from tests.fuzz.one_sided import judged
from tests.helpers import one_sided_models

SCENES = range(16)


@pytest.mark.parametrize("seed", SCENES)
def test_no_contact_is_missed_entered_or_pulls_and_every_impact_obeys_the_law(seed: int) -> None:
    verdict = judged(one_sided_models.scene(seed))
    assert verdict.outcome == "done"
    assert verdict.faults == []
