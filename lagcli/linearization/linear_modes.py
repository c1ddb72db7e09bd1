"""From a reference motion to its modes, each shape as one reads it, and the verdict on stability, as far as it goes.

Two theorems decide for the nonlinear motion: Lyapunov's first method (all eigenvalues left of the imaginary axis, or
one right of it) and that of Lagrange and Dirichlet (a strict minimum of an energy that is kept). Nothing else does.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Literal, NamedTuple

import numpy as np

from lagcli import doubles
from lagcli.arrays import Complex, Floats
from lagcli.errors import diagnostics
from lagcli.linear import decompositions
from lagcli.linearization import floquet, lowest, spectrum
from lagcli.linearization.linearized import LinearizedFunctions, Reference
from lagcli.linearization.reference import Steady
from lagcli.linearization.spectrum import Spectrum
from lagcli.model.model import Model, Units

About = Literal["equilibrium", "steady", "periodic"]

# Models of more coordinates have their lowest modes looked for, and how many of them where nobody says.
DENSE, WANTED = 600, 20
GROWING = "small deviations grow as exp({:.6g} t)"
# The rounding of multipliers: the integration leaves 1e-9 of them over a period. At 1e-7
# `test_a_multiplier_leaves_the_unit_circle_by_more_than_the_rounding_of_a_period` of
# `tests/unit/test_numbers_of_linear_equations.py` fails.
UNIT = 1e-8
MINIMUM = "the potential has a strict minimum there (Lagrange and Dirichlet)"


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


class StabilityVerdict(NamedTuple):
    """Stable or not, or None where the linear equations do not decide; growth: the largest real part."""

    stable: bool | None
    growth: float
    reason: str


def modes(
    functions: LinearizedFunctions,
    found: Steady,
    notes: tuple[str, ...],
    wanted: int = WANTED,
    is_minimum: bool | None = None,
) -> Modes:
    """The modes about a motion whose linear equations do not depend on t; wanted: how many of a large model;
    is_minimum: if the potential is strictly least there. Raises `diagnostics.ModelError`, `lowest.NotFoundError`."""
    model = functions.system.model
    if found.here.q.size > DENSE:
        frequencies, eigenvalues, shapes, verdict, count, note = _of_lowest(functions, found, wanted)
        notes = (*notes, note)
    else:
        try:
            free = spectrum.freedoms(found.linear, functions.stiffness_terms(found.here, found.linear))
        except spectrum.NoFreedomsError as error:
            row = functions.system.rows.rows[-1]
            raise diagnostics.error("singular-constraints", str(error), row.location) from None
        every = spectrum.compute(free)
        values, shapes, verdict = every.values, _shapes(every), _verdict(functions, found, every, is_minimum)
        # Angular frequencies, one for each freedom of positions; none where some eigenvalue has a real part
        swinging = np.sort(values.imag[values.imag > 0])
        still = np.zeros(max(0, every.freedoms - swinging.size))
        frequencies = None if values.real.any() else np.concatenate([still, swinging])
        # All eigenvalues, zeros first, then by imaginary and real parts, conjugates side by side
        eigenvalues = np.concatenate([np.zeros(every.zeros, dtype=complex), values[_order(values)]])
        count = eigenvalues.size
    return Modes(
        "equilibrium" if found.kind == "equilibrium" else "steady",
        _state_columns(model, found.here),
        model.coordinate_names,
        frequencies,
        eigenvalues,
        shapes,
        *verdict,
        count,
        notes=notes,
        title=model.title,
        units=model.units,
    )


def _of_lowest(
    functions: LinearizedFunctions, motion: Steady, wanted: int
) -> tuple[Floats | None, Complex, Complex, StabilityVerdict, int, str]:
    """The lowest modes of a large model: frequencies, eigenvalues, shapes, verdict, count of all, a note."""
    found = lowest.modes(motion.linear, wanted)
    is_swinging = not found.values.real.any()
    both, rows = list[complex](), list[Complex]()
    for s, shape in zip(found.values, found.shapes.T, strict=True):
        row = _normalized(shape)
        if s.imag:
            own, pair = [s, s.conjugate()], [row, row.conj()]
        else:
            own, pair = ([s, -s], [row, row]) if found.has_all_growing else ([s], [row])
        both += own
        rows += pair[:1] if is_swinging else pair
    note = f"the lowest {found.values.size} modes of a model with {found.count} eigenvalues"
    if found.has_all_growing and not found.is_complete:
        note += "; some occur more often than they are given"
    growth = float(found.values.real.max()) if found.values.size else 0.0
    if growth > 0:
        verdict = StabilityVerdict(False, growth, GROWING.format(growth))
    elif motion.kind == "equilibrium" and found.is_definite and functions.keeps_energy(motion.here):
        verdict = StabilityVerdict(True, 0.0, MINIMUM)
    elif found.has_all_growing:
        reason = "no eigenvalue is to the right of the imaginary axis: terms left out decide"
        verdict = StabilityVerdict(None, 0.0, reason)
    else:
        verdict = StabilityVerdict(None, growth, "only the lowest eigenvalues were looked at")
    frequencies = np.abs(found.values.imag) if is_swinging else None
    return frequencies, np.array(both, dtype=complex), np.array(rows), verdict, found.count, note


def of_cycle(orbit: floquet.FollowedMotion, T: float, notes: tuple[str, ...]) -> Modes:
    """The multipliers of a motion with the period T, and its exponents log(multiplier)/T."""
    multipliers, shapes = orbit.cycle(T)
    model, judged = orbit.functions.system.model, of_multipliers(multipliers, T, not orbit.numeric.has_time)
    return Modes(
        "periodic",
        _state_columns(model, orbit.here),
        model.coordinate_names,
        None,
        (np.log(multipliers) / T).astype(complex),
        np.array([_normalized(shape) for shape in shapes]).reshape(shapes.shape),
        *judged,
        multipliers.size,
        T,
        multipliers,
        notes,
        model.title,
        model.units,
    )


def _state_columns(model: Model, here: Reference) -> dict[str, float]:
    """The coordinates of a state by their columns, and velocities where some are not zero."""
    columns = dict(zip(model.coordinate_names, here.q.tolist(), strict=True))
    if np.any(here.v):
        columns |= zip(model.rate_names, here.v.tolist(), strict=True)
    return columns


# Shapes: in order, the largest entry of each 1, no rounding


def _order(values: Complex) -> list[int]:
    size = float(np.abs(values).max(initial=0.0)) or 1.0
    near = np.round(values / size, 12)
    return sorted(range(values.size), key=lambda i: (abs(near[i].imag), near[i].real, -near[i].imag))


def _shapes(found: Spectrum) -> Complex:
    """Shapes (j, n): where there are frequencies in their order, else of all eigenvalues in theirs."""
    n, values = found.shapes.shape[0], found.values
    if values.real.any():
        still = _tidy_basis(decompositions.range_basis(found.still).T.astype(complex))
        # A displacement and a drift along it are two zero eigenvalues with one shape.
        zeros = still[[k % len(still) for k in range(found.zeros)]] if len(still) else np.zeros((0, n))
        rows = found.shapes[:, _order(values)].T
        return np.vstack([zeros, *(_normalized(row)[None] for row in rows)])
    forward = np.flatnonzero(values.imag > 0)
    forward = forward[np.argsort(values.imag[forward], kind="stable")]
    count = max(0, found.freedoms - forward.size)
    parts = [_tidy_basis(decompositions.range_basis(found.still)[:, :count].T.astype(complex))]
    w = values.imag[forward]
    breaks = np.flatnonzero(np.diff(w) > doubles.ZERO * w[1:]) + 1
    parts += [_tidy_basis(found.shapes[:, group].T) for group in np.split(forward, breaks) if group.size]
    return np.vstack([np.zeros((0, n)), *parts])


def _tidy_basis(rows: Complex) -> Complex:
    """A basis (k, n) of the same space in which each row is alone in the column of its largest entry."""
    rows = rows.copy()
    if len(rows) > 1:
        for k in range(len(rows)):
            lengths = np.linalg.norm(rows[k:], axis=0)
            column = int(np.argmax(lengths >= (1 - 1e-6) * lengths.max()))
            best = k + int(np.argmax(np.abs(rows[k:, column])))
            rows[[k, best]] = rows[[best, k]]
            rows[k] /= rows[k, column]
            others = np.arange(len(rows)) != k
            rows[others] -= rows[others, column][:, None] * rows[k]
    found = [_normalized(row) for row in rows]
    found.sort(key=lambda row: int(np.argmax(np.abs(row) >= 1 - doubles.ZERO)))
    return np.array(found).reshape(rows.shape)


def _normalized(row: Complex) -> Complex:
    """A shape (n,) with its largest entry, the first of them, 1."""
    size = np.abs(row)
    if not size.any():
        return row
    row = row / row[int(np.argmax(size >= (1 - doubles.ZERO) * size.max()))]
    real, imag = (np.where(np.abs(part) <= doubles.ZERO, 0.0, part) for part in (row.real, row.imag))
    real, imag = (np.where(np.abs(np.abs(x) - 1) <= doubles.VALUE, np.sign(x), x) for x in (real, imag))
    return np.asarray(real + 1j * imag)


# Stability


def _verdict(
    functions: LinearizedFunctions, motion: Steady, found: Spectrum, is_minimum: bool | None
) -> StabilityVerdict:
    """The verdict on a reference motion whose linear equations do not depend on t."""
    if not found.values.size and not found.zeros:
        return StabilityVerdict(True, 0.0, "no freedom is left: nothing can swing, and there are no modes")
    growth = float(found.values.real.max(initial=0.0 if found.zeros else -np.inf))
    if growth > 0:
        return StabilityVerdict(False, growth, GROWING.format(growth))
    if not found.zeros and growth < 0:
        reason = f"all small deviations die away, the slowest as exp({growth:.6g} t) (Lyapunov)"
        return StabilityVerdict(True, growth, reason)
    is_strict = found.is_definite if is_minimum is None else is_minimum
    is_at_rest = motion.kind == "equilibrium" and found.is_conservative
    if is_at_rest and is_strict and functions.keeps_energy(motion.here):
        return StabilityVerdict(True, 0.0, MINIMUM)
    if found.zeros:
        kinds = f"{found.zeros} eigenvalues are zero" if found.zeros > 1 else "one eigenvalue is zero"
        reason = (
            f"{kinds}: along some deviations nothing brings back or drives away, and terms left out decide"
        )
    elif found.is_conservative and not found.is_definite:
        reason = (
            "all eigenvalues are imaginary without a minimum of the potential: gyroscopic terms hold it, and terms"
            " left out decide"
        )
    else:
        reason = "some eigenvalues are imaginary and none is to the right: terms left out decide"
    return StabilityVerdict(None, 0.0, reason)


def of_multipliers(multipliers: Complex, T: float, is_autonomous: bool) -> StabilityVerdict:
    """The verdict on a motion with the period T; one multiplier of an autonomous motion is 1 and says nothing."""
    sizes = np.abs(multipliers)
    largest = float(sizes.max(initial=0.0))
    growth = float(np.log(largest) / T) if largest > 0 else -np.inf
    if largest > 1 + UNIT:
        reason = f"a small deviation is {largest:.6g} times as large a period later"
        return StabilityVerdict(False, growth, reason)
    rest = np.sort(sizes)[: sizes.size - int(is_autonomous)]
    if rest.max(initial=0.0) < 1 - UNIT:
        what = "all small deviations but that along the motion" if is_autonomous else "all small deviations"
        return StabilityVerdict(
            True, 0.0 if is_autonomous else growth, f"{what} die away (Andronov and Witt)"
        )
    reason = "some multipliers lie on the unit circle and none outside: terms left out decide"
    return StabilityVerdict(None, 0.0, reason)
