"""The numeric functions of a system: CasADi functions of (t, state, parameters), which other values need not build
anew.

The state is y = (q, v, W), shape (2n + 1,), with W the work of all that may change the Jacobi energy; it certifies the
run and does not steer it. lambda at an instant, from (D.24) with the rows differentiated once, S and M factored as L D
L^T with their sparsity: S lambda = gamma - B M^-1 h, S = B M^-1 B^T, a = M^-1 (h + B^T lambda).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import cached_property, wraps
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled import parts as shared
from lagcli.compiled import selection as choice
from lagcli.compiled.factorization import Expanded, Factored
from lagcli.compiled.selection import Selection
from lagcli.equations import narrow_functions, operation_rules
from lagcli.equations.system import System
from lagcli.memory import Memory
from lagcli.smoothness import named_functions
from lagcli.smoothness.sized_function import SizedFunction

if TYPE_CHECKING:
    from lagcli.compiled.contact_kinds import ContactKind
    from lagcli.compiled.contact_values import ContactValues
    from lagcli.compiled.force_switches import ForceSwitches
    from lagcli.compiled.narrow_arguments import NarrowArguments
    from lagcli.equations.level_functions import LevelExpression


# Of the position projection: the error of a step or an interpolation is small, and two quadratic steps reach rounding.
NEWTON_STEPS = 2
# Up to this many multiplications the factorization of S is written out in the graph. Beyond, the graph takes
# longer to build than a run takes, and a numeric factorization is no slower.
EXPANDED_OPERATIONS = 3e5
# How far integrals may move a projected state, weighed against its residual: of a state that is projected where 1e-9 of
# its size is left, by a hundredth of its size.
THROWN = 1e-7


def _of_steps(make: Callable[[NumericSystem], ca.Function]) -> cached_property[ca.Function]:
    """A function of the system whose functions make the steps, made there once."""

    @wraps(make)
    def function(numeric: NumericSystem) -> ca.Function:
        own = numeric.stepped
        return make(numeric) if own is numeric else getattr(own, make.__name__)

    return cached_property(function)


class _Compiled(cached_property[ca.Function]):
    """The function of some inputs (t, q, v, y, p) of a system, by the name of the attribute."""

    def __init__(self, inputs: str, results: Callable[[NumericSystem], list[ca.SX]]) -> None:
        def build(own: NumericSystem) -> ca.Function:
            return SizedFunction(self.attrname or "", [own._symbols[x] for x in inputs.split()], results(own))

        super().__init__(build)


class NumericSystem:
    """Compiled functions of one system, each built when it is first asked for: a count needs no step. selection: the
    independent rows that it is stepped with; closed_rows: the contacts that act, each beyond C."""

    def __init__(
        self, system: System, parts: shared.Parts | None = None, switched: NumericSystem | None = None
    ) -> None:
        self._system, self._switched = system, switched
        self._parts = parts or shared.build(system)
        self.n: int = system.symbols.q.numel()
        self.selection, self.closed_rows = self._parts.selection, self._parts.closed
        self._inputs = [system.symbols.t, system.symbols.q, system.symbols.v, system.p]
        self._symbols = {**dict(zip("tqvp", self._inputs, strict=True)), "y": self._parts.y}
        self.memory = Memory()

    def holding(self, charts: Sequence[LevelExpression]) -> NumericSystem:
        """The system with first integrals enforced in these charts; its p goes on with the two constants of each."""
        return NumericSystem(self._system, self._parts.holding(charts))

    @property
    def has_time(self) -> bool:
        """True if t occurs in what moves the system; else the motion from a start is the same at any time."""
        return self.stepped._parts.has_time

    @cached_property
    def is_conservative(self) -> bool:
        """True if the Jacobi energy stays: no force without potential, no row that moves, no time."""
        power, rates = self._system.dynamics.power, ca.densify(self._system.rows.b)
        return not self.has_time and bool(power.is_zero()) and bool(rates.is_zero())

    @cached_property
    def has_narrow_functions(self) -> bool:
        """True if a function of place that moves the system may be narrow, see `narrow_functions`."""
        return narrow_functions.are_any(self._system.model, bool(self._parts.closed))

    @cached_property
    def narrow_arguments(self) -> NarrowArguments | None:
        if not self.has_narrow_functions:
            return None
        # Most models have no such function.
        from lagcli.compiled import narrow_arguments

        return narrow_arguments.find(self._system, bool(self._parts.closed))

    @cached_property
    def has_linear_momenta(self) -> bool:
        """True if no velocity occurs in M (D.34)."""
        return not ca.depends_on(self._parts.M, self._system.symbols.v)

    def keeping(self, selection: Selection) -> NumericSystem:
        """The system stepped with these independent rows."""
        return NumericSystem(self._system, dataclasses.replace(self._parts, selection=selection))

    def switching(self, selection: Selection) -> NumericSystem:
        """As `keeping`, where it can by functions that sets of closed contacts share, which take `switches` after p."""
        whole = selection.switched(self._parts.B.shape[0])
        if whole is None:
            return self.keeping(selection)

        def all_closed() -> NumericSystem | None:
            parts = self._parts.switched(whole)
            every = None if parts is None else NumericSystem(self._system, parts)
            # Switches stand in expanded factors alone.
            return every if every and isinstance(every._way, Expanded) else None

        every = self.memory.answer(("all closed", whole), all_closed)
        parts = dataclasses.replace(self._parts, selection=selection)
        return NumericSystem(self._system, parts, every)

    @property
    def stepped(self) -> NumericSystem:
        """The system whose functions make the steps: this one, or one that it shares with other sets of contacts."""
        return self._switched or self

    @property
    def switches(self) -> Floats:
        """1 of contacts that are closed and 0 of others (K,), where the functions of steps take them; else none."""
        if self._switched is None:
            return np.zeros(0)
        C = self._parts.B.shape[0]
        return np.isin(np.arange(C, self.selection.count), self.closed_rows).astype(float)

    @cached_property
    def _way(self) -> Expanded | Factored:
        parts = self._parts
        largest = max(map(choice.operations, (parts.S, parts.S_enforced) if parts.g.numel() else (parts.S,)))
        return Expanded(parts) if largest <= EXPANDED_OPERATIONS else Factored(parts)

    @property
    def rhs(self) -> ca.Function:
        """rhs(t, y, p) -> y' (2n + 1,)."""
        return self.stepped._way.rhs

    @property
    def stage(self) -> ca.Function | None:
        """stage(t, y, p) -> y' (2n + 1,), and `parts.rank_margin` (2,).

        None where S is factored numerically: another solution at each stage would cost too much.
        """
        way = self.stepped._way
        return way.stage if isinstance(way, Expanded) else None

    @_of_steps
    def project(self) -> ca.Function:
        """project(t, y, p) -> y on f = 0 and B v + b = 0, y' there, a status of four, and `parts.Sizes.packed`. The
        status is `parts.status` and the sum of y', finite only where all of y' is. A state that g = 0 threw far off,
        onto another branch, counts as not projected."""
        t, y, p = inputs = _inputs(self._way.projection)
        projected, rate, _, status, sizes = self._way.projection(t, self._projected(t, y, p), p)
        residual = status[0]
        if self._parts.g.numel():
            thrown = ca.mmax(ca.fabs((projected - y)[: self.n] / sizes[: self.n]))
            residual += THROWN * thrown / (sizes[self.n] + doubles.TINY)
        status = ca.vertcat(residual, status[1:], ca.sum1(rate))
        return SizedFunction("project", inputs, [projected, rate, ca.densify(status), sizes])

    @_of_steps
    def record(self) -> ca.Function:
        """record(t, y, p) -> y projected, one row of the table without t, and the figures of the account: position
        drift, velocity drift, Jacobi energy and its part without velocities."""
        t, y, p = inputs = _inputs(self._way.projected)
        projected, rate, lam = self._way.projected(t, self._projected(t, y, p), p)
        lam = self._parts.multipliers(t, projected, p, lam)
        row, account = table(self._system, self._parts)(t, projected, rate, lam, p)
        return SizedFunction("record", inputs, [projected, row, account])

    holonomic = _Compiled("t q p", lambda own: list(own._parts.holonomic))
    """holonomic(t, q, p) -> f (s,), B of the holonomic rows (s, n)."""

    @cached_property
    def hessian(self) -> ca.Function:
        """hessian(t, q, omega, p) -> (n, n), the second derivatives of omega . f by q; omega (s,)."""
        t, q, _, p = self._inputs
        omega = ca.SX.sym("omega", self._parts.f.numel())
        return SizedFunction("hessian", [t, q, omega, p], [ca.hessian(ca.dot(omega, self._parts.f), q)[0]])

    @cached_property
    def rows(self) -> ca.Function:
        """rows(t, q, v, p) -> B (C, n), b (C,); where contacts act, all K of them too, after the others."""
        B, b = self._parts.B, self._parts.b
        if self._parts.closed:
            contacts = self._parts.contacts
            B, b = ca.sparsify(ca.vertcat(B, contacts.G)), ca.vertcat(b, contacts.g_t)
        return SizedFunction("rows", self._inputs, [B, b])

    @cached_property
    def contacts(self) -> ca.Function:
        """contacts(t, q, v, p) -> g (K,), G (K, n), g_t (K,), gamma (K,), and sum |G_i q_i| (K,), the terms of g."""
        contacts = self._parts.contacts
        size = ca.fabs(contacts.G) @ ca.fabs(self._parts.y[: self.n])
        g, *others = map(ca.densify, (contacts.g, contacts.g_t, contacts.gamma, size))
        return SizedFunction("contacts", self._inputs, [g, contacts.G, *others])

    @cached_property
    def contact_values(self) -> ContactValues:
        from lagcli.compiled.contact_values import ContactValues

        return ContactValues(self._parts, self.contact_kinds)

    @cached_property
    def contact_kinds(self) -> list[ContactKind]:
        """See `ContactKind`."""
        from lagcli.compiled import contact_kinds

        return contact_kinds.found(self._parts)

    def contact_motion(self, contacts: Sequence[int]) -> ca.Function:
        """contact_motion(t, q, v, p) -> h (n,), gamma of equality rows (C,) and of some contacts (k,), entries of M, B
        and their G."""
        parts, G = self._parts, self._parts.contacts.G[list(contacts), :]
        entries = [ca.vec(each.nz[:]) for each in (parts.M, parts.B, G)]
        gamma = ca.densify(parts.contacts.gamma)[list(contacts)]
        outputs = map(ca.densify, (parts.h, parts.gamma, gamma, *entries))
        return SizedFunction("contact_motion", self._inputs, list(outputs))

    @property
    def response(self) -> ca.Function:
        """response(t, q, v, p, f) -> the velocities x (n,) that an impulse f (n,) gives against the independent
        equality rows and the impulses of those (C,), and `parts.responded`."""
        return self._way.response

    gaps = _Compiled("t y p", lambda own: [ca.densify(own._parts.contacts.g)])
    """gaps(t, y, p) -> g (K,)."""

    @cached_property
    def moving_gaps(self) -> list[ca.Function]:
        """Of each of the `contact_kinds` moving(t, q, p, dt, dq) -> g and its change, (2,), of its own coordinates."""
        from lagcli.compiled import contact_values

        return [contact_values.moving(self._parts, kind) for kind in self.contact_kinds]

    @cached_property
    def gap_floors(self) -> ca.Function:
        from lagcli.compiled import contact_values

        return contact_values.floors(self._parts, self.contact_kinds)

    @property
    def lying_rows(self) -> list[int]:
        """Those that act, and those that are closed and carry nothing."""
        return [*self.closed_rows, *self.selection.idle_rows]

    @_of_steps
    def solved(self) -> ca.Function:
        """solved(t, y, p) -> y' (2n + 1,) and lambda of all rows (C + K,), the state as it is."""
        t, y, p = inputs = _inputs(self._way.projected)
        _, rate, lam = self._way.projected(t, y, p)
        return SizedFunction("solved", inputs, [rate, self._parts.multipliers(t, y, p, lam)])

    @cached_property
    def loads(self) -> ca.Function:
        """loads(t, y, p, lambda of all rows) -> `selection.loads` of the idle contacts, (I,)."""
        return self._parts.loads

    @cached_property
    def event_values(self) -> ca.Function:
        """event_values(t, y, y', lambda, p) -> `when` of the declared events, (E,)."""
        inputs = [self._parts.t, self._parts.y, *_solved(self._system), self._parts.p]
        return SizedFunction("event_values", inputs, [ca.densify(self._system.event_values)])

    @_of_steps
    def events_at(self) -> ca.Function:
        """events_at(t, y, p) -> `when` of the declared events (E,) at a state."""
        t, y, p = inputs = _inputs(self._way.projected)
        rate, lam = self.solved(t, y, p)
        return SizedFunction("events_at", inputs, [self.event_values(t, y, rate, lam, p)])

    @cached_property
    def force_switches(self) -> ForceSwitches | None:
        if not named_functions.velocity_switches(self._system.model):
            return None
        # Most models have no such force.
        from lagcli.compiled import force_switches

        return force_switches.find(self._system)

    @cached_property
    def joint_reactions(self) -> ca.Function:
        """joint_reactions(t, q, v, p, lambda) -> force and torque of each joint, (6 J,), linear in lambda (C + K,)."""
        whole, count = self._system.of_bodies, 6 * len(self._system.model.joints)
        reactions = ca.densify(whole[whole.numel() - count :])
        return SizedFunction("joint_reactions", [*self._inputs, self._system.lam], [reactions])

    inertia = _Compiled("t q v p", lambda own: [own._parts.M])
    """inertia(t, q, v, p) -> M (n, n)."""

    sizes = _Compiled("t q v p", lambda own: [own._sizes(own._parts.h)])
    """sizes(t, q, v, p) -> `parts.Sizes.packed` (n + 3,)."""

    term_sizes = _Compiled("t q v p", lambda own: [own._sizes(*own._terms(own._parts.h))])
    """term_sizes(t, q, v, p) -> what `sizes` gives with the terms of h in its place, which may cancel."""

    row_terms = _Compiled("t q v p", lambda own: own._terms(own._parts.f, own._parts.b))
    """row_terms(t, q, v, p) -> the sizes of the terms of f (s,) and of b (C,), which may cancel."""

    force_roundings = _Compiled(
        "t q v p", lambda own: own._terms(own._parts.h, own._parts.gamma, are_exact=True)
    )
    """force_roundings(t, q, v, p) -> the rounding of h (n,) and of gamma (C,), in units of it."""

    energy_terms = _Compiled("t q v p", lambda own: own._terms(own._system.dynamics.jacobi, are_exact=True))
    """energy_terms(t, q, v, p) -> by how many units of its rounding the Jacobi energy may be off."""

    @_of_steps
    def state_roundings(self) -> ca.Function:
        """state_roundings(t, q, v, p) -> `parts.roundings`, (2, 3), with the p of steps."""
        inputs = [*self._inputs[:3], self._parts.p]
        return SizedFunction("state_roundings", inputs, [shared.roundings(self._parts, inputs)])

    @property
    def force(self) -> ca.Function:
        """force(t, q, v, p) -> h (n,), gamma (C,), power."""
        return self._parts.force

    @cached_property
    def applied(self) -> ca.Function:
        """applied(t, q, v, p) -> Q_j (n,) of all that is declared under `forces` (D.30)."""
        dynamics = self._system.dynamics
        Q = dynamics.driving - ca.gradient(dynamics.potential, self._system.symbols.q)
        return SizedFunction("applied", self._inputs, [ca.densify(Q)])

    def _sizes(self, h: ca.SX) -> ca.SX:
        parts = self._parts
        return shared.sizes(parts, parts.v, h, parts.M).packed

    def _terms(self, *values: ca.SX, are_exact: bool = False) -> list[ca.SX]:
        return [operation_rules.term_sizes(ca.densify(x), self._inputs, are_exact) for x in values]

    def _projected(self, t: ca.MX, y: ca.MX, p: ca.MX) -> ca.MX:
        for _ in range(NEWTON_STEPS):
            y = self._way.position(t, y, p)
        return y


def _inputs(function: ca.Function) -> list[ca.MX]:
    return [ca.MX.sym(name, function.size1_in(i)) for i, name in enumerate("typ")]


def _solved(system: System) -> list[ca.SX]:
    """y' and lambda as arguments."""
    rate = ca.vertcat(ca.SX.sym("v", system.symbols.q.numel()), system.a, ca.SX.sym("power"))
    return [rate, system.lam]


def table(system: System, parts: shared.Parts) -> ca.Function:
    """table(t, y, y', lambda, p) -> one row of the table without t, and the figures of the account."""
    model, dynamics, symbols = system.model, system.dynamics, system.symbols
    particles, n = system.r.numel() // 3, symbols.q.numel()
    first = n - len(model.generalized_names)
    moving = ca.vertcat(ca.reshape(system.r, 3, particles), ca.reshape(system.r_dot, 3, particles))
    generalized = ca.horzcat(symbols.q[first:], symbols.v[first:])
    values = [ca.vec(moving), ca.vec(generalized.T), system.lam, system.R, system.Q_R[first:]]
    values += [system.of_bodies, dynamics.energy, system.outputs]
    account = ca.vertcat(*shared.residuals(parts), dynamics.jacobi, dynamics.rest)
    row, open_ = ca.vertcat(*values), list(parts.selection.inactive)
    if open_ and not parts.switches.numel():
        # Of thousands that are open reactions are sums of zeros.
        row = ca.substitute(row, system.lam[open_], ca.SX.zeros(len(open_)))
    inputs = [parts.t, parts.y, *_solved(system), parts.p]
    options = {"cse": parts.is_small}
    return SizedFunction("table", inputs, [ca.densify(row), ca.densify(account)], options)
