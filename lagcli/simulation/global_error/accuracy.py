"""The known error of a run at its end, as numbers and as a sentence."""

from __future__ import annotations

import math
from typing import Any

from lagcli.frozen import frozen_value

KINDS = ("r", "v", "lambda", "R")
_NAMES = ("positions", "velocities", "multipliers", "R")
# A kind that has less digits than these at the end is reported with the time up to which it had them.
SURE = 3


@frozen_value
class Accuracy:
    """The estimate at the last row, t; four numbers each, in the order of `KINDS`.

    errors: of the largest component up to t, in the units of the columns; scales: the largest value up to t;
    until: time of the last row before the error first exceeded a thousandth of the scale, t where it never did;
    rtol: the tolerance of the steps of the repeated run; steps, rejected, evaluations: its account. zero: kinds of
    which all values are zero to rounding; parted: between which times the two runs have gone apart at once, one of them
    having missed a force; None where they have not.
    between: how many rows stand between the times of one incident in both runs, and the time of the first: they count
    for positions alone; growth: by how much each impact makes errors grow, None where they do not grow exponentially.
    energy_error: of a run whose energy is not kept though it should be, as a part of the energy exchanged, else 0.
    """

    t: float
    errors: tuple[float, ...]
    scales: tuple[float, ...]
    until: tuple[float, ...]
    rtol: float
    steps: int
    rejected: int
    evaluations: int
    zero: frozenset[str] = frozenset()
    parted: tuple[float, float] | None = None
    between: tuple[int, float] | None = None
    growth: float | None = None
    energy_error: float = 0.0

    @property
    def digits(self) -> dict[str, float | None]:
        """log10(scale / error) of each kind, not below 0, and no more than the energy has; None where all values are
        zero, to rounding, or there are none."""
        triples = zip(KINDS, self.errors, self.scales, strict=True)
        most = self.energy_error
        return {
            k: None if k in self.zero else _digits(max(error, most * scale), scale)
            for k, error, scale in triples
        }

    @property
    def sentence(self) -> str:
        """The digits of all kinds in words; empty where nothing but zeros was computed."""
        reported: list[str] = []
        for name, digits, until in zip(_NAMES, self.digits.values(), self.until, strict=True):
            if digits is None:
                continue
            count = str(math.floor(digits))
            better = f" (to {SURE} up to t = {until:.9g})" if digits < SURE and until < self.t else ""
            reported.append(f"{name} to {count}{better}" if reported else self._first(name, count, better))
        none = [name for kind, name in zip(KINDS, _NAMES, strict=True) if kind in self.zero]
        if none:
            is_one = none == ["R"]
            reported.append(f"{' and '.join(none)} {'is' if is_one else 'are'} zero to rounding")
        return ", ".join(reported) + self._parting + self._incidents + self._energy

    @property
    def _energy(self) -> str:
        if not self.energy_error:
            return ""
        return (
            f"; the energy should stay and is off by {self.energy_error:.1e} of what is exchanged: no more digits are"
            " claimed than it has, and both runs may have missed the same force"
        )

    @property
    def _incidents(self) -> str:
        sentence = ""
        if self.growth is not None:
            sentence += (
                f"; errors grow about {self.growth:.2g} times at each impact, as they do at convex bodies: no tolerance"
                " helps for long"
            )
        if self.between is not None:
            count, first = self.between
            rows = "1 row stands" if count == 1 else f"{count} rows stand"
            sentence += (
                f"; {rows} between the times that an incident has in both runs ({'' if count == 1 else 'the first '}at"
                f" t = {first:.9g}): velocities there are those before it or behind it, and are not counted"
            )
        return sentence

    @property
    def _parting(self) -> str:
        if self.parted is None:
            return ""
        early, late = self.parted
        return (
            f"; the two runs go apart between t = {early:.9g} and {late:.9g}: one of them did not see a force there, so"
            " bound the steps with --max-step"
        )

    def _first(self, name: str, count: str, better: str) -> str:
        verb = "is" if name == "R" else "are"
        return f"{name} {verb} right to {count} digits up to t = {self.t:.9g}{better}"

    def as_json(self) -> dict[str, Any]:
        """The objects of `--stats`: digits, errors, the times up to which there are three digits, and the repeated
        run."""
        return {
            "digits": self.digits,
            "errors": dict(zip(KINDS, self.errors, strict=True)),
            "three_digits_until": dict(zip(KINDS, self.until, strict=True)),
            "repeated": {
                "step_rtol": self.rtol,
                "steps": self.steps,
                "rejected": self.rejected,
                "evaluations": self.evaluations,
                "parted": None if self.parted is None else list(self.parted),
                **({} if self.between is None else {"rows_between": self.between[0]}),
                **({} if self.growth is None else {"growth_at_impacts": self.growth}),
            },
        }


def _digits(error: float, scale: float) -> float | None:
    if not scale:
        return None
    return max(0.0, math.log10(scale / error)) if math.isfinite(error) else 0.0
