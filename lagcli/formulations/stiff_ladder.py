"""A ladder of stiffnesses, the forces of its runs beside lambda, and the rate at which they tend to it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

# Runs a decade, and of one comparison: with a tenth or ten times as many
# `test_a_ladder_has_two_rungs_a_decade_and_two_hundred_at_most` of `tests/unit/test_numbers_of_formulations.py` fails.
RUNGS, MOST_RUNGS = 2, 200
# A ladder ends where what its run is uncertain by is more than this part of its error.
UNCERTAIN = 0.1


def rungs(text: str | Sequence[float]) -> tuple[float, ...]:
    """The stiffnesses of `LOW:HIGH`, two a decade, of `LOW:HIGH:COUNT`, of one number, or those that are given.

    Raises `ValueError`.
    """
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

    max_error: the largest |-k f - lambda| over the rows; mean_error: |its time mean| over whole swings, None where the
    swings are too many to be resolved; mean_uncertainty: of that mean, from where the swings are cut; uncertainty: of
    the force, by the tolerance of the run and by rounding; force (T,): -k f at the rows.
    """

    stiffness: float
    max_error: float
    mean_error: float | None
    mean_uncertainty: float | None
    steps: int | None
    uncertainty: float
    force: Floats

    def as_json(self) -> dict[str, object]:
        """An entry of `table`."""
        return {
            "stiffness": self.stiffness,
            "max_error": self.max_error,
            "mean_error": self.mean_error,
            "steps": self.steps,
            "mean_uncertainty": self.mean_uncertainty,
            "uncertainty": self.uncertainty,
        }


@dataclasses.dataclass(frozen=True, slots=True)
class Rate:
    """error = 10^at k^slope, fitted to the logarithms; error: the standard error of the slope, None for two points."""

    slope: float
    at: float
    error: float | None

    def line(self, k: Floats) -> Floats:
        """The fitted errors at stiffnesses (K,)."""
        return np.asarray(10.0**self.at * k**self.slope)


def fitted(k: Sequence[float], errors: Sequence[float]) -> Rate | None:
    """The rate of errors, or None where there are fewer than two or one of them is zero."""
    if len(k) < 2 or not all(error > 0 and math.isfinite(error) for error in errors):
        return None
    x, y = np.log10(np.array(k)), np.log10(np.array(errors))
    about = x - x.mean()
    slope = float(about @ y / (about @ about))
    at = float(y.mean() - slope * x.mean())
    if len(k) == 2:
        return Rate(slope, at, None)
    left = y - at - slope * x
    return Rate(slope, at, float(np.sqrt(left @ left / (len(k) - 2) / (about @ about))))


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class StiffLimit:
    """The stiff limit of one row: what `limit` returns.

    start: `adapted` or `unprestressed`; t (T,) and multiplier (T,): the rows of the constrained run and its lambda;
    rungs: one run each, of a ramp one window each; rate: of `rate_of`, `max_error` or `mean_error`; ended: why the
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
        names = ("stiffness", "max_error", "mean_error", "steps", "mean_uncertainty", "uncertainty")
        rows = [[_number(one.as_json()[name]) for name in names] for one in self.rungs]
        return names, np.array(rows).reshape(-1, len(names))

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


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else math.nan


def mean_of_swings(t: Floats, error: Floats) -> tuple[float, float | None]:
    """The time mean of an error over whole swings, and what it is uncertain by: the two ways of cutting whole swings.

    A swing begins where the error passes its middle upwards, or else downwards. Without two whole swings the mean is
    over all times, and nothing is known of its uncertainty.
    """
    middle = (error.max() + error.min()) / 2
    about = error - middle
    up, down = (_crossings(t, sign * about) for sign in (1.0, -1.0))
    if len(up) < 3 or len(down) < 3:
        return _mean(t, error, float(t[0]), float(t[-1])), None
    means = [_mean(t, error, float(ends[0]), float(ends[-1])) for ends in (up, down)]
    return (means[0] + means[1]) / 2, abs(means[0] - means[1]) / 2


def _crossings(t: Floats, value: Floats) -> Floats:
    """The times at which a curve passes zero upwards."""
    at = np.flatnonzero((value[:-1] < 0) & (value[1:] >= 0))
    part = -value[at] / (value[at + 1] - value[at])
    return np.asarray(t[at] + part * (t[at + 1] - t[at]))


def _mean(t: Floats, value: Floats, begin: float, end: float) -> float:
    """The mean of a curve between two times, by the trapezoidal rule."""
    inside = (t > begin) & (t < end)
    times = np.concatenate([[begin], t[inside], [end]])
    values = np.interp(times, t, value)
    if end <= begin:
        return float(values[0])
    return float(np.sum((values[1:] + values[:-1]) * np.diff(times)) / 2 / (end - begin))
