"""The functions of a system with its factorizations: expanded into the graph, the fastest way while S is small, or with
S factored numerically at each call, as a solve node between expanded parts."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cached_property

import casadi as ca
import numpy as np

from lagcli.compiled import parts as shared
from lagcli.compiled import selection
from lagcli.compiled.parts import Parts
from lagcli.smoothness.sized_function import SizedFunction

SOLVER = "ldl"
# A fixed one: the numbers must not change from run to run.
SEED = 20063


class SystemFunctions:
    """What both ways have in common: functions that solve B M^-1 B^T x = r once."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    def _through(
        self, name: str, inputs: list[ca.SX], B: ca.SX, r: ca.SX, after: Callable[[ca.SX], list[ca.SX]]
    ) -> ca.Function:
        """The function with the results `after(x)`; B: of the independent rows, or of those that are enforced."""
        raise NotImplementedError

    @cached_property
    def position(self) -> ca.Function:
        """position(t, y, p) -> y after one Newton step onto f = 0 and g = 0 along M^-1 B^T, towards the nearest
        point."""
        parts, n = self._parts, self._parts.v.numel()
        f, B = parts.enforced
        if f.numel() == 0:
            return SizedFunction("position", parts.inputs, [parts.y])

        def after(mu: ca.SX) -> list[ca.SX]:
            q = parts.y[:n] - parts.inertia(B.T @ mu)
            return [ca.densify(ca.vertcat(q, parts.y[n:]))]

        return self._through("position", parts.inputs, B, f, after)

    @cached_property
    def response(self) -> ca.Function:
        parts = self._parts
        f = ca.SX.sym("f", parts.v.numel())
        free, B = parts.inertia(f), parts.B_independent

        def after(lam: ca.SX) -> list[ca.SX]:
            x = parts.inertia(f + parts.reaction(lam))
            return [ca.densify(x), lam, shared.responded(parts, f, free, x)]

        inputs = [parts.t, parts.y[: f.numel()], parts.v, parts.p, f]
        return self._through("response", inputs, B, ca.densify(-(B @ free)), after)


class Expanded(SystemFunctions):
    """rhs, position and projection of one system, as functions of (t, y, p)."""

    def _through(
        self, name: str, inputs: list[ca.SX], B: ca.SX, r: ca.SX, after: Callable[[ca.SX], list[ca.SX]]
    ) -> ca.Function:
        parts, schur = self._parts, self._watched[0]
        if B is parts.enforced[1] and parts.S_enforced is not parts.S:
            schur = selection.solver(parts.S_enforced)
        return SizedFunction(name, inputs, after(ca.densify(schur(r)) if r.numel() else ca.SX(0, 1)))

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
        """projected(t, y, p) -> the first three results of `projection`."""
        return SizedFunction("projected", self._parts.inputs, list(self._projected[1:]))

    @cached_property
    def _projected(self) -> tuple[Parts, ca.SX, ca.SX, ca.SX]:
        """The parts at the projected velocity; y with it, y' and lambda."""
        parts, inertia, schur = self._parts, self._parts.inertia, self._watched[0]
        y, v, n = parts.y, parts.v, parts.v.numel()
        if parts.selection.independent:
            v = v - inertia(parts.B_independent.T @ schur(parts.B_independent @ v + parts.of_independent[0]))
        v = ca.densify(v)
        there = parts.moving(v)
        if ca.depends_on(parts.M, parts.v):
            there = dataclasses.replace(there, M=ca.substitute(parts.M, parts.v, v))
            inertia, schur = there.inertia, selection.solver(there.S)
        a, lam = _acceleration(there, inertia, schur)
        projected = ca.densify(ca.vertcat(y[:n], v, y[2 * n]))
        return there, projected, shared.state_rate(there, a, lam), lam

    @cached_property
    def _watched(self) -> tuple[selection.Solve, ca.SX | float]:
        """r -> S^-1 r, and the smallest angle of S."""
        return selection.watched(self._parts.S)


def _acceleration(parts: Parts, inertia: selection.Solve, schur: selection.Solve) -> tuple[ca.SX, ca.SX]:
    """a and lambda of (D.24), with M^-1 and S^-1 as solvers."""
    free = inertia(parts.h)
    if not parts.selection.independent:
        return free, ca.SX(0, 1)
    lam = ca.densify(schur(parts.of_independent[1] - parts.B_independent @ free))
    return inertia(parts.h + parts.reaction(lam)), lam


class Factored(SystemFunctions):
    """rhs, position and projection of one system, as functions of (t, y, p)."""

    def _through(
        self, name: str, inputs: list[ca.SX], B: ca.SX, r: ca.SX, after: Callable[[ca.SX], list[ca.SX]]
    ) -> ca.Function:
        x = ca.SX.sym("x", B.size1())
        results = SizedFunction("after", [*inputs, x], after(x))
        given = [ca.MX.sym(f"x{i}", each.numel()) for i, each in enumerate(inputs)]
        found = self._solved(inputs, B, r, given)
        return SizedFunction(name, given, results.call([*given, found]))

    def _solved(self, inputs: list[ca.SX], B: ca.SX, r: ca.SX, given: list[ca.MX]) -> ca.MX:
        """The solution x of B M^-1 B^T x = r at given inputs."""
        parts = self._parts
        other = parts.MB if B is parts.B_independent else parts.inertia(B.T)
        before = SizedFunction("before", inputs, [B, other, r])
        rows, spread, right = before(*given)
        return ca.solve(ca.mtimes(rows, spread), right, SOLVER)

    @cached_property
    def rhs(self) -> ca.Function:
        inputs = self._inputs()
        return SizedFunction("rhs", inputs, [self._acceleration(*inputs)[0]])

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
        parts, B = self._parts, self._parts.B_independent
        y, v, n = parts.y, parts.v, parts.v.numel()
        mu = ca.SX.sym("mu", B.size1())
        projected = ca.densify(ca.vertcat(y[:n], v - parts.inertia(B.T @ mu), y[2 * n]))
        after = SizedFunction("after", [*parts.inputs, mu], [projected])
        t, _, p = inputs = self._inputs()
        rights = ca.horzcat(ca.densify(B @ v + parts.of_independent[0]), *more)
        found = self._solved(parts.inputs, B, rights, inputs)
        there = after(*inputs, found[:, 0])
        return inputs, [there, *self._acceleration(t, there, p)], found

    @cached_property
    def _acceleration(self) -> ca.Function:
        """(t, y, p) -> y' and lambda of (D.24)."""
        parts, B = self._parts, self._parts.B_independent

        def after(lam: ca.SX) -> list[ca.SX]:
            return [shared.state_rate(parts, parts.inertia(parts.h + parts.reaction(lam)), lam), lam]

        right = ca.densify(parts.of_independent[1] - B @ parts.inertia(parts.h))
        return self._through("acceleration", parts.inputs, B, right, after)

    def _inputs(self) -> list[ca.MX]:
        return [ca.MX.sym(name, x.numel()) for name, x in zip("typ", self._parts.inputs, strict=True)]
