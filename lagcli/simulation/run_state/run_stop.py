"""A run that ends before its end, as a noun: the numbers raise `StepFailure`, the loop says where with `RunStop`."""

from __future__ import annotations

from typing import NamedTuple

from lagcli.frozen import frozen_value

# Why a run stops, as codes for `lagcli explain`.
SINGULAR, NO_SOLUTION = "singular-constraints", "no-solution-beyond"
NOT_FINITE, TOO_SMALL = "not-finite", "step-too-small"
CONTACT, STICKS = "contact-undecided", "motion-sticks"


@frozen_value
class Stop:
    """The reason why a run ended before its end: the time, a sentence, and one of the codes of `catalogue.stops`."""

    t: float
    reason: str
    code: str


class RunStop(Exception):
    """The integration cannot go on; rows given so far are complete and right."""

    def __init__(self, stop: Stop) -> None:
        super().__init__(stop.reason)
        self.stop = stop


class Reason(NamedTuple):
    """Why no step can be taken, or no row written: a sentence without the time, and its code."""

    sentence: str
    code: str


class StepFailure(Exception):
    """No step can be taken, or no row written, for a `Reason`."""

    def __init__(self, sentence: str, code: str) -> None:
        super().__init__(sentence)
        self.reason, self.code = Reason(sentence, code)
