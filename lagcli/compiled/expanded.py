"""The functions of a system with their factorizations expanded into the graph: the fastest way while S is small."""

from __future__ import annotations

import dataclasses
from functools import cached_property

import casadi as ca

from lagcli.compiled import parts as shared
from lagcli.compiled import solvers
from lagcli.compiled.parts import Parts
from lagcli.smoothness.sized_function import SizedFunction


class Expanded:
    """rhs, position and projection of one system, as functions of (t, y, p)."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    @cached_property
    def rhs(self) -> ca.Function:
        """rhs(t, y, p) -> y'."""
        a, lam = _acceleration(self._parts, self._parts.inertia, self._schur)
        return SizedFunction("rhs", self._parts.inputs, [shared.state_rate(self._parts, a, lam)])

    @cached_property
    def stage(self) -> ca.Function:
        """stage(t, y, p) -> y', and `parts.rank_margin`."""
        parts = self._parts
        a, lam = _acceleration(parts, parts.inertia, self._schur)
        outputs = [shared.state_rate(parts, a, lam), shared.rank_margin(parts, self._watched[1])]
        return SizedFunction("stage", parts.inputs, outputs)

    @cached_property
    def position(self) -> ca.Function:
        """position(t, y, p) -> y after one Newton step onto f = 0 and g = 0 along M^-1 B^T.

        That is towards the nearest point in the mass-weighted norm.
        """
        parts = self._parts
        y, n = parts.y, parts.v.numel()
        if parts.enforced.numel() == 0:
            return SizedFunction("position", parts.inputs, [y])
        schur = self._schur if parts.S_enforced is parts.S else solvers.solver(parts.S_enforced)
        q = y[:n] - parts.inertia(parts.B_enforced.T @ schur(parts.enforced))
        return SizedFunction("position", parts.inputs, [ca.densify(ca.vertcat(q, y[n:]))])

    @cached_property
    def projection(self) -> ca.Function:
        """projection(t, y, p) -> y with the velocity projected onto B v + b = 0, y' and lambda there, `status`,
        `sizes`.

        One factorization serves all, unless M depends on the velocity that is projected.
        """
        parts, (there, *results) = self._parts, self._projected
        sizes = shared.sizes(parts, there.v, there.h, there.M)
        status = shared.status(parts, self._watched[1], there.v, sizes)
        return SizedFunction("projection", parts.inputs, [*results, status, sizes.packed])

    @cached_property
    def projected(self) -> ca.Function:
        """projected(t, y, p) -> the results of `project` but the first, all that a row of the table needs."""
        return SizedFunction("projected", self._parts.inputs, list(self._projected[1:]))

    @cached_property
    def _projected(self) -> tuple[Parts, ca.SX, ca.SX, ca.SX]:
        """The parts at the projected velocity; y with it, y' and lambda."""
        parts, inertia, schur = self._parts, self._parts.inertia, self._schur
        y, v, n = parts.y, parts.v, parts.v.numel()
        if parts.selection.independent:
            v = v - inertia(parts.B_independent.T @ schur(parts.B_independent @ v + parts.b_independent))
        v = ca.densify(v)
        there = parts.moving(v)
        if ca.depends_on(parts.M, parts.v):
            there = dataclasses.replace(there, M=ca.substitute(parts.M, parts.v, v))
            inertia, schur = there.inertia, solvers.solver(there.S)
        a, lam = _acceleration(there, inertia, schur)
        projected = ca.densify(ca.vertcat(y[:n], v, y[2 * n]))
        return there, projected, shared.state_rate(there, a, lam), lam

    @cached_property
    def response(self) -> ca.Function:
        """See `NumericSystem.response`."""
        parts = self._parts
        f = ca.SX.sym("f", parts.v.numel())
        free = parts.inertia(f)
        lam = (
            ca.densify(self._schur(-(parts.B_independent @ free)))
            if parts.selection.independent
            else ca.SX(0, 1)
        )
        x = parts.inertia(f + parts.reaction(lam))
        inputs = [parts.t, parts.y[: f.numel()], parts.v, parts.p, f]
        return SizedFunction("response", inputs, [ca.densify(x), lam, shared.responded(parts, f, free, x)])

    @cached_property
    def _watched(self) -> tuple[solvers.Solve, ca.SX | float]:
        """r -> S^-1 r, and the smallest angle of S."""
        return solvers.watched(self._parts.S)

    @property
    def _schur(self) -> solvers.Solve:
        return self._watched[0]


def _acceleration(parts: Parts, inertia: solvers.Solve, schur: solvers.Solve) -> tuple[ca.SX, ca.SX]:
    """a and lambda of (D.24), with M^-1 and S^-1 as solvers."""
    free = inertia(parts.h)
    if not parts.selection.independent:
        return free, ca.SX(0, 1)
    lam = ca.densify(schur(parts.gamma_independent - parts.B_independent @ free))
    return inertia(parts.h + parts.reaction(lam)), lam
