"""From a reference motion to its modes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.linearization import floquet, freedoms, lowest, ordered_modes, spectrum, stability
from lagcli.linearization.linear_modes import Modes
from lagcli.linearization.linearized import LinearizedFunctions, Reference
from lagcli.linearization.reference import Steady

Complex = npt.NDArray[np.complex128]

# Models of more coordinates have their lowest modes looked for, and how many of them where nobody says.
DENSE, WANTED = 600, 20


def modes(
    functions: LinearizedFunctions, found: Steady, notes: tuple[str, ...], wanted: int = WANTED
) -> Modes:
    """The modes about a motion whose linear equations do not depend on t; wanted: how many of a large model.

    Raises `diagnostics.ModelError`, `lowest.NotFoundError`.
    """
    built = functions.system
    if found.here.q.size > DENSE:
        return _of_lowest(functions, found, wanted, notes)
    free = _free(built, found)
    every = spectrum.spectrum(free)
    judged = stability.verdict(functions, found.here, every, found.kind == "equilibrium")
    values = ordered_modes.eigenvalues(every)
    return Modes(
        "equilibrium" if found.kind == "equilibrium" else "steady",
        state_columns(built, found.here),
        built.model.coordinate_names,
        ordered_modes.frequencies(every),
        values,
        ordered_modes.shapes(every),
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
    some = lowest.lowest(found.linear, wanted)
    judged = stability.of_lowest(functions, found.here, some, found.kind == "equilibrium")
    values = some.values
    both = [z for s in values for z in ((s, s.conjugate()) if s.imag else (s, -s) if some.is_whole else (s,))]
    rows = [ordered_modes.normalized(shape) for shape in some.shapes.T]
    told = f"the lowest {values.size} modes of a model with {some.count} eigenvalues"
    if some.is_whole and not some.is_complete:
        told += "; some occur more often than they are given"
    is_swinging = not values.real.any()
    if not is_swinging:
        rows = [row for s, row in zip(values, rows, strict=True) for row in _both(s, row, some.is_whole)]
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
        notes=(*notes, told),
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
        np.array([ordered_modes.normalized(shape) for shape in found.shapes]).reshape(found.shapes.shape),
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


def _free(built: System, found: Steady) -> freedoms.Freedoms:
    try:
        return freedoms.freedoms(found.linear, found.here.q)
    except freedoms.HiddenConditionError:
        row = built.rows.rows[built.holonomic_count]
        message = (
            "the differential rows are dependent there, and hold small deviations of positions to more than they"
            " say"
        )
        raise diagnostics.ModelError(
            [diagnostics.Diagnostic("singular-constraints", message, row.location)]
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
