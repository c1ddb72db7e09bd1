"""The error of a search that ends without a certain answer."""

from __future__ import annotations

from lagcli import progress


class Undecided(Exception):
    """The search cannot go on; the text says why."""


class AmbiguousRank(Undecided):
    """A value that counts neither as zero nor as certainly not zero."""

    def __init__(self, size: float) -> None:
        super().__init__(f"a bracket has the relative size {size:.1e}, neither zero nor certainly not")


def require_time(deadline: float) -> None:
    """Raise `Undecided` after a deadline of `progress.after`, `OverTime` where the time of the whole work is over."""
    progress.require_time()
    if progress.left(deadline) < 0:
        raise Undecided("the time limit ended the search for brackets")
