"""The result of `lagcli.modes`."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Literal

import numpy as np
import numpy.typing as npt

from lagcli.model.model import Units

Floats = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
About = Literal["equilibrium", "steady", "periodic"]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """Small deviations from an equilibrium, a steady or a periodic motion.

    about: which; at: the columns of the state there, velocities where something moves. coordinates (n): the columns
    of shapes. eigenvalues (k,) in 1/time; frequencies (m,), angular, ascending, with zeros, or None where an
    eigenvalue is neither imaginary nor zero. shapes (j, n), largest entry 1: one for each of the frequencies, or else
    for each of the eigenvalues. stable, growth (largest real part) and reason: the verdict, None where the linear
    equations do not decide. period and multipliers: of a periodic motion, else None. count: how many eigenvalues
    there are in all; notes: what was found on the way.
    """

    about: About
    at: Mapping[str, float]
    coordinates: tuple[str, ...]
    frequencies: Floats | None
    eigenvalues: Complex
    shapes: Complex
    stable: bool | None
    growth: float
    reason: str
    count: int
    period: float | None = None
    multipliers: Complex | None = None
    notes: tuple[str, ...] = ()
    title: str = ""
    units: Units | None = None

    def __repr__(self) -> str:
        verdict = {True: "stable", False: "unstable", None: "not decided"}[self.stable]
        if self.multipliers is not None:
            return f"<Modes about a periodic motion, period {self.period:.6g}: {verdict}>"
        if self.frequencies is not None:
            lowest = ", ".join(f"{w:.6g}" for w in self.frequencies[:4])
            more = ", ..." if self.frequencies.size > 4 else ""
            return f"<Modes: frequencies {lowest}{more}; {verdict}>"
        return f"<Modes: {self.eigenvalues.size} eigenvalues, growth {self.growth:.6g}; {verdict}>"

    def as_json(self) -> dict[str, object]:
        """The object of `modes --json`."""
        return {
            "about": self.about,
            "at": dict(self.at),
            "coordinates": list(self.coordinates),
            "frequencies": None if self.frequencies is None else self.frequencies.tolist(),
            "eigenvalues": _pairs(self.eigenvalues),
            "shapes": [shape_as_json(shape) for shape in self.shapes],
            "stable": self.stable,
            "growth": self.growth,
            "reason": self.reason,
            "period": self.period,
            "multipliers": None if self.multipliers is None else _pairs(self.multipliers),
            "notes": list(self.notes),
        }


def shape_as_json(shape: Complex) -> list[float] | list[list[float]]:
    """The entries of a shape: numbers, or pairs where one is complex."""
    return _pairs(shape) if np.abs(shape.imag).max(initial=0.0) else shape.real.tolist()


def _pairs(values: Complex) -> list[list[float]]:
    # + 0.0: no negative zeros.
    return [[float(z.real) + 0.0, float(z.imag) + 0.0] for z in values]
