"""From a reference motion to its modes: in order, each shape as one reads it, its largest entry 1, no rounding."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.linear import decompositions
from lagcli.linearization import floquet, freedoms, lowest, spectrum, stability
from lagcli.linearization.linear_modes import Modes
from lagcli.linearization.linearized import LinearizedFunctions, Reference
from lagcli.linearization.reference import Steady
from lagcli.linearization.spectrum import Spectrum

Floats = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

# Models of more coordinates have their lowest modes looked for, and how many of them where nobody says.
DENSE, WANTED = 600, 20


def modes(
    functions: LinearizedFunctions,
    found: Steady,
    notes: tuple[str, ...],
    wanted: int = WANTED,
    is_minimum: bool | None = None,
) -> Modes:
    """The modes about a motion whose linear equations do not depend on t; wanted: how many of a large model;
    is_minimum: whether the potential has a strict minimum there, None where that is not known.

    Raises `diagnostics.ModelError`, `lowest.NotFoundError`.
    """
    built = functions.system
    if found.here.q.size > DENSE:
        return _of_lowest(functions, found, wanted, notes)
    free = _free(functions, found)
    every = spectrum.compute(free)
    judged = stability.verdict(functions, found, every, is_minimum)
    # All eigenvalues, zeros first, then by imaginary and real parts, conjugates side by side
    order = _order(every.values)
    values = np.concatenate([np.zeros(every.zeros, dtype=complex), every.values[order]])
    return Modes(
        "equilibrium" if found.kind == "equilibrium" else "steady",
        state_columns(built, found.here),
        built.model.coordinate_names,
        _frequencies(every),
        values,
        _shapes(every),
        judged.stable,
        judged.growth,
        judged.reason,
        values.size,
        notes=notes,
        title=built.model.title,
        units=built.model.units,
    )


def _of_lowest(functions: LinearizedFunctions, found: Steady, wanted: int, notes: tuple[str, ...]) -> Modes:
    """The lowest modes of a large model."""
    built = functions.system
    some = lowest.modes(found.linear, wanted)
    judged = stability.of_lowest(functions, found.here, some, found.kind == "equilibrium")
    values = some.values
    both = [
        z
        for s in values
        for z in ((s, s.conjugate()) if s.imag else (s, -s) if some.has_all_growing else (s,))
    ]
    rows = [_normalized(shape) for shape in some.shapes.T]
    note = f"the lowest {values.size} modes of a model with {some.count} eigenvalues"
    if some.has_all_growing and not some.is_complete:
        note += "; some occur more often than they are given"
    is_swinging = not values.real.any()
    if not is_swinging:
        rows = [
            row for s, row in zip(values, rows, strict=True) for row in _both(s, row, some.has_all_growing)
        ]
    return Modes(
        "equilibrium" if found.kind == "equilibrium" else "steady",
        state_columns(built, found.here),
        built.model.coordinate_names,
        np.abs(values.imag) if is_swinging else None,
        np.array(both, dtype=complex),
        np.array(rows),
        judged.stable,
        judged.growth,
        judged.reason,
        some.count,
        notes=(*notes, note),
        title=built.model.title,
        units=built.model.units,
    )


def _both(s: complex, row: Complex, has_opposite: bool) -> list[Complex]:
    """The shapes of an eigenvalue and of the one that goes with it."""
    if s.imag:
        return [row, row.conj()]
    return [row, row] if has_opposite else [row]


def of_cycle(orbit: floquet.FollowedMotion, T: float, notes: tuple[str, ...]) -> Modes:
    """The multipliers of a motion with the period T, and its exponents log(multiplier)/T."""
    built = orbit.functions.system
    found = floquet.cycle(orbit, T)
    judged = stability.of_multipliers(found.multipliers, T, not orbit.numeric.has_time)
    return Modes(
        "periodic",
        state_columns(built, orbit.here),
        built.model.coordinate_names,
        None,
        (np.log(found.multipliers) / T).astype(complex),
        np.array([_normalized(shape) for shape in found.shapes]).reshape(found.shapes.shape),
        judged.stable,
        judged.growth,
        judged.reason,
        found.multipliers.size,
        T,
        found.multipliers,
        notes,
        built.model.title,
        built.model.units,
    )


def _free(functions: LinearizedFunctions, found: Steady) -> freedoms.Freedoms:
    try:
        return freedoms.find(found.linear, functions.stiffness_terms(found.here, found.linear))
    except freedoms.NoFreedomsError as error:
        row = functions.system.rows.rows[-1]
        raise diagnostics.ModelError(
            [diagnostics.Diagnostic("singular-constraints", str(error), row.location)]
        ) from None


def state_columns(built: System, here: Reference) -> dict[str, float]:
    """The coordinates of a state by their columns, and velocities where some are not zero."""
    names = built.model.coordinate_names
    generalized = set(built.model.generalized_names)
    columns = {name: float(x) for name, x in zip(names, here.q, strict=True)}
    if np.any(here.v):
        speeds = [f"rate({name})" if name in generalized else f"{name[:-1]}v{name[-1]}" for name in names]
        columns |= {name: float(x) for name, x in zip(speeds, here.v, strict=True)}
    return columns


def _order(values: Complex) -> list[int]:
    size = float(np.abs(values).max(initial=0.0)) or 1.0
    near = np.round(values / size, 12)
    return sorted(range(values.size), key=lambda i: (abs(near[i].imag), near[i].real, -near[i].imag))


def _frequencies(found: Spectrum) -> Floats | None:
    """Angular frequencies, ascending, one for each freedom of positions; None where some eigenvalue has a real part."""
    if found.values.real.any():
        return None
    positive = np.sort(found.values.imag[found.values.imag > 0])
    return np.concatenate([np.zeros(max(0, found.freedoms - positive.size)), positive])


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
