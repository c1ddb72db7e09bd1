"""The outcome of a comparison of the two principles, with its words."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence


@dataclasses.dataclass(frozen=True, slots=True)
class PartingPoint:
    """The time of the first row where positions differ by more than the tolerance, and their largest difference
    with its column and time; sizes are those of the column itself."""

    t: float
    largest: float
    column: str
    t_largest: float


@dataclasses.dataclass(frozen=True, slots=True)
class Principles:
    """The outcome of a comparison of vakonomic motion with d'Alembert's.

    mu: initial multipliers of the differential rows, those that were given; integrable: the rows that are;
    nonholonomic: those that are not; undecided: those of which neither is known; digits: to which positions and
    velocities agree, of the largest value of each, None where there is nothing to compare; parting: where positions
    part, or None; left_out: outputs and events without a value in vakonomic motion; until: the time up to which both
    go, where one of them stopped.
    """

    mu: Mapping[str, float]
    integrable: tuple[str, ...]
    nonholonomic: tuple[str, ...]
    undecided: tuple[str, ...]
    tolerance: float
    digits: float | None = None
    parting: PartingPoint | None = None
    left_out: tuple[str, ...] = ()
    until: float | None = None

    @property
    def agree(self) -> bool | None:
        """True if positions and velocities agree within the tolerance; None where there is nothing to compare."""
        return None if self.digits is None else 10.0**-self.digits <= self.tolerance

    def as_json(self) -> dict[str, object]:
        """The object `principles` of `compare --vakonomic --json`."""
        return {**dataclasses.asdict(self), "mu": dict(self.mu), "agree": self.agree}

    @property
    def sentence(self) -> str:
        """The outcome in words."""
        rows = _listed(self.nonholonomic)
        if self.digits is None:
            return "there is nothing to compare"
        if not self.mu:
            return "there is no differential row: the two principles are the same equations"
        if self.agree:
            as_far = "" if self.until is None else f" up to t = {self.until:.9g}, as far as both go"
            sentence = f"the two principles agree to {self.digits:.1f} digits{as_far}"
            if self.nonholonomic:
                return f"{sentence}, for this start: {rows} not integrable, and in general they part"
            if self.undecided:
                return f"{sentence}; whether {_listed(self.undecided, 'is', 'are')} integrable is undecided"
            return f"{sentence}, as they must: the differential rows are integrable"
        sentence = "the two principles part"
        if self.nonholonomic:
            sentence += f", for {rows} not integrable"
        elif not self.undecided:
            sentence += (
                ", though the differential rows are integrable: the error of one of the runs is larger"
            )
        if self.parting is None:
            return f"{sentence}: velocities differ, positions do not within {self.tolerance:g}"
        where = self.parting
        return (
            f"{sentence}: positions differ by more than {self.tolerance:g} of their size from t = {where.t:.9g} on,"
            f" `{where.column}` by {where.largest:.4g} at t = {where.t_largest:.9g}"
        )


def _listed(names: Sequence[str], one: str = "is", several: str = "are") -> str:
    quoted = [f"`{name}`" for name in names[:3]] + (["others"] if len(names) > 3 else [])
    return f"{', '.join(quoted)} {one if len(names) == 1 else several}"
