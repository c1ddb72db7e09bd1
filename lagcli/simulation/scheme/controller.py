"""The length of steps: how it follows their errors, and when a run would not end in any time one can wait."""

from __future__ import annotations

# Part of the step that the error asks for, and bounds of its change from one step to the next.
SAFETY, SHRINK, GROW = 0.9, 0.2, 10.0
# Every PACE steps a run is asked how many more it would take like this; HOPELESS many would take days.
PACE, HOPELESS = 5000, 1e10


class StepController:
    """The step proposed for a method of some order, and the time of the last look at the pace."""

    def __init__(self, order: int, step: float, pace_from: float) -> None:
        self._exponent = -1.0 / order
        self.step, self.pace_from = step, pace_from

    def smaller(self, taken: float, error: float, is_known: bool) -> float:
        """The step to be tried after one that was rejected; is_known: for its error, of 1 or more."""
        part: float = min(0.9, max(SHRINK, SAFETY * error**self._exponent)) if is_known else 0.25
        return taken * part

    def grown(self, taken: float, error: float, most: float) -> float:
        """The step to be tried after one that was accepted, no more than `most` times as long."""
        part: float = min(most, max(SHRINK, SAFETY * max(error, 1e-10) ** self._exponent))
        return taken * part

    def lags(self, t: float, end: float) -> float | None:
        """To be asked every `PACE` steps: by how much they advanced, where that would never lead to the end."""
        advanced, self.pace_from = t - self.pace_from, t
        return advanced if (end - t) * PACE > HOPELESS * advanced else None
