"""A ladder of stiffnesses, the forces of its runs beside lambda, and the rate at which they tend to it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np

from lagcli.arrays import Floats
from lagcli.linear import decompositions

# Runs a decade, and of one comparison: with a tenth or ten times as many
# `test_a_ladder_has_two_rungs_a_decade_and_two_hundred_at_most` of `tests/unit/test_numbers_of_formulations.py` fails.
RUNGS, MOST_RUNGS = 2, 200
# A ladder ends where what its run is uncertain by is more than this part of its error.
UNCERTAIN = 0.1
# In fewer swings the weights of the mean without swings rise and fall as these do.
FEWEST_SWINGS = 4
# Of a table with a row for each stiffness.
COLUMNS = (
    *("stiffness", "max_error", "mean_error", "steps"),
    *("mean_uncertainty", "weighted_mean", "uncertainty"),
)


def rungs(text: str | Sequence[float]) -> tuple[float, ...]:
    """The stiffnesses of `LOW:HIGH`, two a decade, of `LOW:HIGH:COUNT`, or those given. Raises `ValueError`."""
    if not isinstance(text, str):
        found = tuple(float(k) for k in text)
        if not found or not all(math.isfinite(k) and k > 0 for k in found):
            raise ValueError("stiffness: positive numbers are needed")
        return tuple(sorted(set(found)))
    parts = text.split(":")
    try:
        ends = [float(part) for part in parts[:2]]
        count = int(parts[2]) if len(parts) == 3 else None
    except ValueError:
        raise ValueError(f"stiffness {text}: write LOW:HIGH, such as 1e3:1e5") from None
    if len(parts) > 3 or not all(math.isfinite(k) and k > 0 for k in ends):
        raise ValueError(f"stiffness {text}: write LOW:HIGH, two positive numbers")
    low, high = ends[0], ends[-1]
    if high < low:
        raise ValueError(f"stiffness {text}: the first is the least")
    if count is None:
        count = 1 if high == low else max(2, round(RUNGS * math.log10(high / low)) + 1)
    if not 1 <= count <= MOST_RUNGS or (count == 1 and high != low):
        raise ValueError(f"stiffness {text}: from 2 to {MOST_RUNGS} runs are made")
    if count == 1:
        return (low,)
    powers = np.linspace(math.log10(low), math.log10(high), count)
    # Whole powers of ten are themselves, whatever the logarithm rounds to.
    return (low, *(float(f"{10.0**power:.12g}") for power in powers[1:-1]), high)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Rung:
    """One run of the ladder.

    max_error: the largest |-k f - lambda| over the rows; mean_error: |its time mean|, None where swings are not
    resolved; mean_uncertainty: how far that is off at most, by the times of the mean and the tolerances of both runs;
    weighted_mean: |its mean| with weights that leave no swings in it, None where there are fewer than four;
    uncertainty: of the force, by the tolerance of the run and by rounding; force (T,): -k f at the rows.
    """

    stiffness: float
    max_error: float
    mean_error: float | None
    mean_uncertainty: float | None
    weighted_mean: float | None
    steps: int | None
    uncertainty: float
    force: Floats

    def as_json(self) -> dict[str, float | None]:
        """An entry of `table`."""
        return {name: getattr(self, name) for name in COLUMNS}


@dataclasses.dataclass(frozen=True, slots=True)
class Rate:
    """error = 10^at k^slope (1 + further/k) by logarithms; error: what the slope is off by, None for two points."""

    slope: float
    at: float
    error: float | None
    further: float = 0.0

    def line(self, k: Floats) -> Floats:
        """The fitted errors at stiffnesses (K,)."""
        return np.asarray(10.0**self.at * k**self.slope * 10.0 ** (self.further / k))


def fitted(k: Sequence[float], errors: Sequence[float]) -> Rate | None:
    """The rate of errors; None where there are fewer than two or one is zero. The next term in 1/k is fitted to four.

    The slope is off by its interval, 95 % by Student's distribution, and by what it changes without the softest spring.
    """
    if len(k) < 2 or not all(error > 0 and math.isfinite(error) for error in errors):
        return None
    x, y = np.log10(np.array(k)), np.log10(np.array(errors))
    found, error = _line(x, y)
    if len(k) < 3:
        return Rate(found[1], found[0], None)
    without, _ = _line(x[1:], y[1:])
    return Rate(found[1], found[0], error + abs(found[1] - without[1]), found[2])


def _line(x: Floats, y: Floats) -> tuple[tuple[float, float, float], float]:
    """y = a + b x + c 10^(-x) by least squares, c = 0 for fewer than four points, and half the interval of b."""
    from scipy import special

    columns = [np.ones_like(x), x] + ([10.0**-x] if len(x) > 3 else [])
    sizes = [np.abs(column).max() for column in columns]
    scaled = np.column_stack([column / size for column, size in zip(columns, sizes, strict=True)])
    inverse = decompositions.pseudo_inverse(scaled)
    weights = inverse @ y
    left, spare = y - scaled @ weights, len(x) - len(columns)
    found = [*(weights / sizes), 0.0][:3]
    error = 0.0
    if spare:
        variance = (inverse[1] @ inverse[1]) * (left @ left) / spare
        error = float(special.stdtrit(spare, 0.975) * math.sqrt(variance) / sizes[1])
    return (float(found[0]), float(found[1]), float(found[2])), error


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class StiffLimit:
    """The stiff limit of one row: what `limit` returns.

    start: `adapted` or `unprestressed`; t (T,) and multiplier (T,): the rows of the constrained run and its lambda;
    rungs: one run each, of a ramp one window each; rate: of `rate_of`, `max_error` or `weighted_mean`; ended: why the
    ladder ended early, or nothing; ramp: seconds in which one run rose over all of it, or None, then with its
    stiffness (T,) and force (T,); stopped: why a run ended before its end, or nothing.
    """

    path: str
    constraint: str
    start: str
    t: Floats
    multiplier: Floats
    rungs: tuple[Rung, ...]
    rate: Rate | None
    rate_of: str
    ended: str = ""
    ramp: Mapping[str, float] | None = None
    stiffness: Floats | None = None
    force: Floats | None = None
    steps: int = 0
    notes: tuple[str, ...] = ()
    stopped: str = ""

    def __repr__(self) -> str:
        slope = "no rate" if self.rate is None else f"rate {self.rate.slope:.4g}"
        return f"<StiffLimit of {self.constraint} in {self.path}: {len(self.rungs)} stiffnesses, {slope}>"

    @property
    def table(self) -> tuple[tuple[str, ...], Floats]:
        """The names of the columns and the rows: one for each stiffness, of a ramp one for each time."""
        if self.stiffness is not None and self.force is not None:
            names: tuple[str, ...] = ("t", "stiffness", "force", f"lambda.{self.constraint}")
            return names, np.column_stack([self.t, self.stiffness, self.force, self.multiplier])
        rows = [
            [math.nan if value is None else float(value) for value in one.as_json().values()]
            for one in self.rungs
        ]
        return COLUMNS, np.array(rows).reshape(-1, len(COLUMNS))

    def as_json(self) -> dict[str, object]:
        """The object of `limit --json`."""
        rate = self.rate
        return {
            "constraint": self.constraint,
            "rate": None if rate is None else rate.slope,
            "rate_error": None if rate is None else rate.error,
            "rate_of": self.rate_of,
            "start": self.start,
            "ramp": None if self.ramp is None else dict(self.ramp),
            "table": [one.as_json() for one in self.rungs],
            "ended": self.ended or None,
            "stopped": self.stopped or None,
            "notes": list(self.notes),
        }


def time_mean(t: Floats, error: Floats) -> tuple[float, float]:
    """The time mean of an error over all its times, by Simpson's rule, and how far it is off at most: that over every
    second time is off by sixteen times as much."""
    from scipy import integrate

    span = float(t[-1] - t[0])
    rows = np.append(np.arange(0, len(t) - 1, 2), len(t) - 1)
    mean, coarse = (float(integrate.simpson(error[part], x=t[part])) / span for part in (slice(None), rows))
    return mean, abs(mean - coarse)


def mean_without_swings(t: Floats, error: Floats) -> float:
    """The mean of an error with the weight sin^4, which rises and falls smoothly: swings leave k^(-5/2) in it."""
    from scipy import integrate

    weight = np.sin(math.pi * (t - t[0]) / (t[-1] - t[0])) ** 4
    return float(integrate.simpson(weight * error, x=t) / integrate.simpson(weight, x=t))
