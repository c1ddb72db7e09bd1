"""Forces that an action can hold: those with a potential, declared as one or not."""

from __future__ import annotations

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.equations import system
from lagcli.errors import diagnostics
from lagcli.linear import decompositions
from lagcli.model import model as nouns
from lagcli.smoothness.sized_function import SizedFunction

Floats = npt.NDArray[np.float64]

# The curl of a force is looked for at this many points around the start.
SAMPLES = 12
WIDTH = 0.3  # of the size of the start: how far these points are from it


def require_action(built: system.System, t: float, q: Floats, p: Floats) -> None:
    """Raise `diagnostics.ModelError`, located, where the motion is not that of an action: for a force without a
    potential, and for one-sided rows.

    A force that depends on no velocity and has no curl is a gradient, and is taken; t, q (n,), p: the start.
    """
    found = [
        diagnostics.Diagnostic(
            "not-of-an-action",
            f"the one-sided constraint `{law.members.base}` has no place in an action that is stationary: the paths"
            " beside the motion would have to be on one side of it",
            law.equation.location,
            "take it out, or write the rows that are closed as equations",
        )
        for law in built.model.inequality
        if law.members.count
    ]
    driving = built.dynamics.driving
    if not found and driving.nnz():
        found = _without_potential(built, t, q, p)
    if found:
        raise diagnostics.ModelError(found)


def _without_potential(built: system.System, t: float, q: Floats, p: Floats) -> list[diagnostics.Diagnostic]:
    """The fault of the sum of the forces without declared potential, at the first of them."""
    symbols = built.symbols
    Q = built.dynamics.driving
    reason = ""
    if ca.depends_on(Q, symbols.v):
        reason = "it depends on velocities"
    elif _has_curl(built, t, q, p):
        reason = "it has a curl: the work it does depends on the path"
    if not reason:
        return []
    driving = [force for one in built.model.forces if (force := _driving(one)) is not None]
    together = len(driving) > 1
    subject = "the forces without a declared potential have" if together else "this force has"
    reason = (
        reason.replace("it depends", "they depend").replace("it has", "they have") if together else reason
    )
    return [
        diagnostics.Diagnostic(
            "not-of-an-action",
            f"{subject} no potential, and so no place in an action: {reason}",
            driving[0].location,
            "vakonomic motion is that of a Lagrangian; leave the force out, or write its potential",
        )
    ]


def _driving(force: nouns.Force) -> nouns.Expression | None:
    """The text of a force that acts and has no declared potential."""
    if isinstance(force, nouns.Potential) or not force.action.targets.size:
        return None
    if isinstance(force, nouns.GeneralizedForce):
        return force.force
    return None if force.constant else force.force.parts[0]


def _has_curl(built: system.System, t: float, q: Floats, p: Floats) -> bool:
    """True if dQ_i/dq_j and dQ_j/dq_i differ somewhere near the start."""
    symbols = built.symbols
    slope = ca.jacobian(built.dynamics.driving, symbols.q)
    if not slope.nnz():
        return False
    slopes = SizedFunction("slopes", [symbols.t, symbols.q, built.p], [ca.densify(slope)])
    size = float(np.abs(q).max(initial=0.0)) or 1.0
    draws = np.random.default_rng(0).uniform(-1.0, 1.0, (SAMPLES, q.size))
    for number, draw in enumerate(draws):
        found = np.array(slopes(t + 0.1 * number, q + WIDTH * size * draw, p))
        if np.isfinite(found).all() and not decompositions.is_symmetric(found):
            return True
    return False
