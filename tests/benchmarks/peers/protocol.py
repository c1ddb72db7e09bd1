"""What a peer is asked and what it answers: JSON in, one JSON object a line out.

In: {"problem": {...}, "reference": [...], "wanted": 1e-9, "limit": seconds}, with "whole": {"setting", "rows",
"file"} for one run of a known setting that writes a table. Out: a line for each attempt; the last one counts.
The scripts of this folder run in the environment of the peers and import nothing of lagcli.
"""

from __future__ import annotations

import functools
import json
import sys
import time
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Run = Callable[[], tuple[float, Floats]]  # seconds of the solution alone, q at the end

GRAVITY = 9.81
REPEATS = 5


def request() -> dict[str, Any]:
    """What is asked."""
    asked: dict[str, Any] = json.load(sys.stdin)
    return asked


def error(found: Floats, reference: Floats) -> float:
    """The largest error of a coordinate, relative where it exceeds one; infinite where anything is not finite."""
    if not np.isfinite(found).all():
        return float("inf")
    return float(np.max(np.abs(found - reference) / np.maximum(1.0, np.abs(reference))))


def tell(**answer: Any) -> None:
    """Answer with a line."""
    print(json.dumps(answer), flush=True)


class Search:
    """Runs ever finer settings until the wanted error is reached; tells each attempt."""

    def __init__(self, asked: dict[str, Any], build_seconds: float) -> None:
        self._reference = np.array(asked["reference"])
        self._wanted, self._limit = asked["wanted"], asked["limit"]
        self._build_seconds = build_seconds
        self._began = time.perf_counter()

    def left(self) -> float:
        """Seconds of the limit that are left."""
        return float(self._limit - (time.perf_counter() - self._began))

    def attempt(self, setting: str, run: Run) -> tuple[float, float]:
        """One run of a setting, and more where it reaches the error: seconds (the least), error."""
        seconds, found = run()
        reached = error(found, self._reference)
        self._tell(setting, seconds, reached)
        if reached <= self._wanted:
            for _ in range(REPEATS):
                if 2 * seconds < self.left():
                    seconds = min(seconds, run()[0])
            self._tell(setting, seconds, reached)
        return seconds, reached

    def first(self, settings: Iterable[tuple[str, Run]]) -> None:
        """The first setting that reaches the error."""
        for setting, run in settings:
            if self.attempt(setting, run)[1] <= self._wanted or self.left() < 0:
                return

    def by_steps(
        self, setting: str, run: Callable[[int], tuple[float, Floats]], steps: int
    ) -> tuple[int, bool]:
        """For a scheme of order 2 with constant steps: as many as the error of the last attempt asks for.

        Returns the steps last tried, and whether the search is over: reached, or more would not fit in the limit.
        It is not where more steps no longer help.
        """
        before = float("inf")
        while True:
            seconds, reached = self.attempt(f"{setting}, {steps} steps", functools.partial(run, steps))
            if reached <= self._wanted:
                return steps, True
            if not reached < 0.9 * before:
                return steps, False
            before = reached
            more = min(64.0, max(1.3, 1.1 * (reached / self._wanted) ** 0.5))
            if more * seconds > self.left():
                return steps, True
            steps = int(steps * more)

    def _tell(self, setting: str, seconds: float, reached: float) -> None:
        tell(
            setting=setting,
            solve_seconds=seconds,
            error=reached if np.isfinite(reached) else None,
            build_seconds=self._build_seconds,
            reached=reached <= self._wanted,
        )
