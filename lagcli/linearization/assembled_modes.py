"""From a reference motion to its modes."""

from __future__ import annotations

import numpy as np

from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.linearization import floquet, freedoms, ordered_modes, spectrum, stability
from lagcli.linearization.linear_modes import Modes
from lagcli.linearization.linearized import LinearizedFunctions, Reference
from lagcli.linearization.reference import Steady


def modes(functions: LinearizedFunctions, found: Steady, notes: tuple[str, ...]) -> Modes:
    """The modes about a motion whose linear equations do not depend on t. Raises `diagnostics.ModelError`."""
    built = functions.system
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


def of_cycle(orbit: floquet.Orbit, T: float, notes: tuple[str, ...]) -> Modes:
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
