"""The reason why an inertia matrix gives no accelerations: the motions it resists not at all, or with the wrong
sign."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.errors.diagnostics import Diagnostic
from lagcli.linear.metric_rows import Sparse
from lagcli.model.model import Model

Floats = npt.NDArray[np.float64]


class SingularInertiaParameters:
    """An inertia that has fallen. The tests are of `tests/unit/test_start_thresholds.py`."""

    __slots__ = ()

    fallen: float = 1e-3
    """It is told below this part of that at the start (`test_an_inertia_has_fallen_below_a_thousandth`)."""


PARAMETERS = SingularInertiaParameters()
MOST_NAMED = 4  # coordinates of a motion, so that a sentence stays one
_SINGULAR_HINT = (
    "start away from a singular configuration (the centre of polar, the pole of spherical coordinates)"
)


def without_inertia(M: Sparse, model: Model) -> list[Diagnostic]:
    """The coordinates whose row of M (n, n; sparse, finite) is zero: there is no acceleration in their equations."""
    names = model.coordinate_names
    rows = np.asarray(M.sparsity().row(), dtype=int)
    sizes = np.bincount(rows, weights=np.abs(np.array(M.nonzeros(), dtype=float)), minlength=len(names))
    entered = np.bincount(rows, minlength=len(names)) > 0
    found = []
    for i in np.flatnonzero(sizes == 0).tolist():
        if entered[i]:
            message = (
                f"the coordinate `{names[i]}` has no inertia at the start: what the energy holds of its rate has a"
                " second derivative that vanishes there"
            )
            hint = f"{_SINGULAR_HINT} or with another rate, or choose other coordinates"
        else:
            message = (
                f"the coordinate `{names[i]}` has no inertia: no kinetic energy is quadratic in its rate, so its"
                " equation holds no acceleration"
            )
            hint = (
                "give it a mass, or write it as a function of other coordinates, from the constraint if one fixes it;"
                " equations of first order, from a Lagrangian linear in the rate, are not solved"
            )
        found.append(Diagnostic("no-inertia", message, model.location(names[i]), hint))
    return found


def indefinite(M: Floats, model: Model) -> Diagnostic:
    """The motion for which v^T M v is smallest, for an M (n, n) without zero rows that is not positive definite."""
    scale = 1.0 / np.sqrt(np.abs(M).max(axis=1))  # so that the answer does not depend on units
    values, vectors = np.linalg.eigh(M * np.outer(scale, scale))
    motion = scale * vectors[:, 0]
    names = model.coordinate_names
    along, shown = names[int(np.argmax(np.abs(vectors[:, 0])))], _motion(motion, names)
    if values[0] > -doubles.ZERO * values[-1]:
        message = f"no kinetic energy resists the motion {shown} at the start: the inertia matrix is singular"
        hint = (
            "leave out a coordinate that describes the same motion as others (where a constraint fixes it, insert"
            f" what the constraint says), give it a mass, or {_SINGULAR_HINT}"
        )
    else:
        message = (
            f"the kinetic energy of the motion {shown} is negative at the start: the inertia matrix is not positive"
            " definite"
        )
        hint = "correct the sign in the Lagrangian: kinetic energy must grow with every motion"
    return Diagnostic("indefinite-inertia", message, model.location(along), hint)


def fallen(M: Sparse, before: Sparse, names: Sequence[str]) -> str:
    """The loss of the inertia M (n, n) of a later state against `before` at the start, as a sentence, or nothing.

    `before` is positive definite. The least v^T M v / v^T M_before v is asked for, which no units change.
    """
    if M.shape[0] > 300:
        return ""  # eigenvalues would take long
    old, new = np.array(before), np.array(M)
    if not np.isfinite(new).all() or (old == new).all():
        return ""
    scale = 1.0 / np.sqrt(np.diag(old))
    inverse = np.linalg.inv(np.linalg.cholesky(old * np.outer(scale, scale)))
    values, vectors = np.linalg.eigh(inverse @ (new * np.outer(scale, scale)) @ inverse.T)
    if values[0] >= PARAMETERS.fallen:
        return ""
    motion = _motion(scale * (inverse.T @ vectors[:, 0]), names)
    part = f"{values[0]:.2g} times that at the start"
    return f"the inertia of the motion {motion} is {part}: the equations become singular"


def _motion(motion: Floats, names: Sequence[str]) -> str:
    """A motion as its rates, the largest 1 in size: `rate(x) = 1, a.vx = -1`."""
    largest = np.abs(motion).max()
    part = motion / motion[int(np.argmax(np.abs(motion) > 0.999 * largest))]
    moved = np.flatnonzero(np.abs(part) > doubles.ROOT).tolist()
    named = []
    for i in moved[:MOST_NAMED]:
        owner, dot, axis = names[i].rpartition(".")
        rate = f"{owner}.v{axis}" if dot else f"rate({names[i]})"
        named.append(f"{rate} = {part[i]:.4g}")
    more = len(moved) - len(named)
    return f"({', '.join(named)}{f' and {more} more' if more else ''})"
