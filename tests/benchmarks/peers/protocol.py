"""What a program is asked and what it answers: JSON, one object a line.

In: a problem; then a setting a line, each of which is solved. Out: the settings there are, from loose to fine, and what
it took to make the equations; then for each setting q at the end, and processor time: `first`, of the first solution
with all that is compiled for it, and `seconds`, the least of several more. A problem with "once" is solved with that
setting alone. The scripts of this folder run as processes, and but for `lagcli_tiers.py` import nothing of lagcli.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

GRAVITY = 9.81
clock: Callable[[], float] = time.process_time  # of solutions
LONG_ENOUGH, MOST = 0.01, 20  # seconds, and solutions, of which the least counts

Run = Callable[[], Any]  # q at the end


class Solver(NamedTuple):
    """The settings from loose to fine, and what makes a run of one of them."""

    settings: Sequence[str]
    prepare: Callable[[str], Run]


def tolerances(first: int, last: int, step: int = 1) -> list[str]:
    """Powers of ten, by halves of a decade where the step is 1."""
    return [f"{10 ** (-half / 2):.0e}" for half in range(2 * first, 2 * last + 1, step)]


def tell(**answer: Any) -> None:
    """Answer with a line."""
    print(json.dumps(answer), flush=True)


def serve(build: Callable[[dict[str, Any]], Solver]) -> None:
    """Answer what is asked until there is no more."""
    problem = json.loads(sys.stdin.readline())
    began = time.process_time()
    settings, prepare = build(problem)
    if "once" in problem:
        tell(q=np.asarray(prepare(problem["once"])()).tolist())
        return
    tell(settings=list(settings), seconds=time.process_time() - began)
    runs: dict[str, Run] = {}
    for line in sys.stdin:
        setting = json.loads(line)
        before = clock()
        if setting not in runs:
            runs[setting] = prepare(setting)
            runs[setting]()
        first = clock() - before
        times, q = list[float](), None
        while sum(times) < LONG_ENOUGH and len(times) < MOST:
            began = clock()
            q = runs[setting]()
            times.append(clock() - began)
        tell(q=np.asarray(q).tolist(), first=first, seconds=min(times))
