"""The functions of a system with its factorizations: expanded into the graph, the fastest way while S is small, or with
S factored numerically at each call, where expanded factors would be too large to build.

A function of the second kind is a short chain: an expanded part that gives B, M^-1 B^T and a right-hand side, their
product S, a solve node, an expanded part that uses the solution. Written out, S of a large body would have millions of
operations.
"""

from __future__ import annotations

import dataclasses
from functools import cached_property

import casadi as ca
import numpy as np

from lagcli.compiled import parts as shared
from lagcli.compiled import selection
from lagcli.compiled.parts import Parts
from lagcli.smoothness.sized_function import SizedFunction


class Expanded:
    """rhs, position and projection of one system, as functions of (t, y, p)."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    @cached_property
    def rhs(self) -> ca.Function:
        a, lam = _acceleration(self._parts, self._parts.inertia, self._watched[0])
        return SizedFunction("rhs", self._parts.inputs, [shared.state_rate(self._parts, a, lam)])

    @cached_property
    def stage(self) -> ca.Function:
        """stage(t, y, p) -> y', and `parts.rank_margin`."""
        parts = self._parts
        a, lam = _acceleration(parts, parts.inertia, self._watched[0])
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
        schur = self._watched[0] if parts.S_enforced is parts.S else selection.solver(parts.S_enforced)
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
        parts, inertia, schur = self._parts, self._parts.inertia, self._watched[0]
        y, v, n = parts.y, parts.v, parts.v.numel()
        if parts.selection.independent:
            v = v - inertia(parts.B_independent.T @ schur(parts.B_independent @ v + parts.b_independent))
        v = ca.densify(v)
        there = parts.moving(v)
        if ca.depends_on(parts.M, parts.v):
            there = dataclasses.replace(there, M=ca.substitute(parts.M, parts.v, v))
            inertia, schur = there.inertia, selection.solver(there.S)
        a, lam = _acceleration(there, inertia, schur)
        projected = ca.densify(ca.vertcat(y[:n], v, y[2 * n]))
        return there, projected, shared.state_rate(there, a, lam), lam

    @cached_property
    def response(self) -> ca.Function:
        parts = self._parts
        f = ca.SX.sym("f", parts.v.numel())
        free = parts.inertia(f)
        lam = (
            ca.densify(self._watched[0](-(parts.B_independent @ free)))
            if parts.selection.independent
            else ca.SX(0, 1)
        )
        x = parts.inertia(f + parts.reaction(lam))
        inputs = [parts.t, parts.y[: f.numel()], parts.v, parts.p, f]
        return SizedFunction("response", inputs, [ca.densify(x), lam, shared.responded(parts, f, free, x)])

    @cached_property
    def _watched(self) -> tuple[selection.Solve, ca.SX | float]:
        """r -> S^-1 r, and the smallest angle of S."""
        return selection.watched(self._parts.S)


def _acceleration(parts: Parts, inertia: selection.Solve, schur: selection.Solve) -> tuple[ca.SX, ca.SX]:
    """a and lambda of (D.24), with M^-1 and S^-1 as solvers."""
    free = inertia(parts.h)
    if not parts.selection.independent:
        return free, ca.SX(0, 1)
    lam = ca.densify(schur(parts.gamma_independent - parts.B_independent @ free))
    return inertia(parts.h + parts.reaction(lam)), lam


SOLVER = "ldl"
# A fixed one: the numbers must not change from run to run.
SEED = 20063


class Factored:
    """rhs, position and projection of one system, as functions of (t, y, p)."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    @cached_property
    def rhs(self) -> ca.Function:
        inputs = self._inputs()
        rate, _ = self._acceleration(*inputs)
        return SizedFunction("rhs", inputs, [rate])

    @cached_property
    def position(self) -> ca.Function:
        parts = self._parts
        y, n = parts.y, parts.v.numel()
        if parts.enforced.numel() == 0:
            return SizedFunction("position", parts.inputs, [y])
        mu = ca.SX.sym("mu", parts.enforced.numel())
        factors = parts.B_enforced, parts.inertia(parts.B_enforced.T)
        before = SizedFunction("before", parts.inputs, [*factors, parts.enforced])
        moved = ca.densify(ca.vertcat(y[:n] - parts.inertia(parts.B_enforced.T @ mu), y[n:]))
        after = SizedFunction("after", [*parts.inputs, mu], [moved])
        inputs = self._inputs()
        return SizedFunction("position", inputs, [after(*inputs, _solved(before, inputs))])

    @cached_property
    def projection(self) -> ca.Function:
        """projection(t, y, p) -> y with velocity on B v + b = 0, y' and lambda there, `status` and `sizes`.

        The smallest angle is that of S with a unit diagonal, the least eigenvalue but for a factor that changes little:
        1 / |S^-1 z| of a fixed z of length one.
        """
        parts = self._parts
        x = ca.SX.sym("x", len(parts.selection.independent))
        z = np.random.default_rng(SEED).standard_normal(x.numel())
        lengths = ca.sqrt(ca.diag(parts.S))
        inputs, results, found = self._projected(lengths * (z / np.linalg.norm(z)))
        t, _, p = inputs
        sizes = shared.sizes(parts, parts.v, parts.h, parts.M)
        status = shared.status(parts, 1 / ca.norm_2(lengths * x), parts.v, sizes)
        evaluated = SizedFunction("status", [*parts.inputs, x], [status, sizes.packed])
        return SizedFunction("projection", inputs, [*results, *evaluated(t, results[0], p, found[:, 1])])

    @cached_property
    def projected(self) -> ca.Function:
        inputs, results, _ = self._projected()
        return SizedFunction("projected", inputs, results)

    def _projected(self, *more: ca.SX) -> tuple[list[ca.MX], list[ca.MX], ca.MX]:
        """(t, y, p); y with velocity on B v + b = 0, y' and lambda; what S is solved for, and more columns of it."""
        parts = self._parts
        y, v, n = parts.y, parts.v, parts.v.numel()
        mu = ca.SX.sym("mu", len(parts.selection.independent))
        rights = ca.horzcat(ca.densify(parts.B_independent @ v + parts.b_independent), *more)
        before = SizedFunction("before", parts.inputs, [*self._factors, rights])
        projected = ca.densify(ca.vertcat(y[:n], v - parts.inertia(parts.B_independent.T @ mu), y[2 * n]))
        after = SizedFunction("after", [*parts.inputs, mu], [projected])
        t, _, p = inputs = self._inputs()
        found = _solved(before, inputs)
        there = after(*inputs, found[:, 0])
        return inputs, [there, *self._acceleration(t, there, p)], found

    @cached_property
    def response(self) -> ca.Function:
        parts = self._parts
        f = ca.SX.sym("f", parts.v.numel())
        lam = ca.SX.sym("lam", len(parts.selection.independent))
        free, point = parts.inertia(f), [parts.t, parts.y[: f.numel()], parts.v, parts.p]
        before = SizedFunction(
            "before", [*point, f], [*self._factors, ca.densify(-(parts.B_independent @ free))]
        )
        x = ca.densify(parts.inertia(f + parts.reaction(lam)))
        after = SizedFunction("after", [*point, f, lam], [x, shared.responded(parts, f, free, x)])
        inputs = [ca.MX.sym("x", each.numel()) for each in (*point, f)]
        found = _solved(before, inputs)
        moved, evaluated = after(*inputs, found)
        return SizedFunction("response", inputs, [moved, found, evaluated])

    @cached_property
    def _acceleration(self) -> ca.Function:
        """(t, y, p) -> y' and lambda of (D.24)."""
        parts = self._parts
        free = parts.inertia(parts.h)
        right = ca.densify(parts.gamma_independent - parts.B_independent @ free)
        before = SizedFunction("before", parts.inputs, [*self._factors, right])
        lam = ca.SX.sym("lam", len(parts.selection.independent))
        a = parts.inertia(parts.h + parts.reaction(lam))
        after = SizedFunction("after", [*parts.inputs, lam], [shared.state_rate(parts, a, lam)])
        inputs = self._inputs()
        found = _solved(before, inputs)
        return SizedFunction("acceleration", inputs, [after(*inputs, found), found])

    @cached_property
    def _factors(self) -> tuple[ca.SX, ca.SX]:
        """B and M^-1 B^T of the independent rows, whose product is S."""
        B = self._parts.B_independent
        return B, self._parts.inertia(B.T)

    def _inputs(self) -> list[ca.MX]:
        return [ca.MX.sym(name, x.numel()) for name, x in zip("typ", self._parts.inputs, strict=True)]


def _solved(before: ca.Function, inputs: list[ca.MX]) -> ca.MX:
    """The solution x of S x = r for B, M^-1 B^T and r that `before` gives."""
    B, other, r = before(*inputs)
    return ca.solve(ca.mtimes(B, other), r, SOLVER)
