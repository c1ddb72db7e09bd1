"""Switches at which forces jump in the velocities, and those forces, which may push the motion onto them to stick."""

from __future__ import annotations

import itertools

import casadi as ca
import numpy as np

from lagcli.equations import energy, operation_rules
from lagcli.equations.environment import Environment
from lagcli.equations.symbols import FixedExponents
from lagcli.equations.system import System
from lagcli.frozen import frozen
from lagcli.smoothness import named_functions, switches
from lagcli.smoothness.sized_function import SizedFunction


@frozen
class ForceSwitches:
    """The K switches u of F forces that depend on velocities, each zero where it switches.

    names: of the forces; coordinates: for each switch the entries of v that stand in it;
    rates(t, y, y', p) -> u and du/dt, (K,) each;
    drawn(t, h, y, y', new, new', p) -> (K,), 1 where |u| is about to vanish within a step from y, and shrinks at its
    end too;
    forces(t, q, v, p) -> Q_j of each force, one after the other (n F,), and by how much rounding may change them.
    """

    names: tuple[str, ...]
    coordinates: tuple[tuple[int, ...], ...]
    rates: ca.Function
    drawn: ca.Function
    forces: ca.Function

    def clear(self) -> ca.Function:
        """clear(t, h, y, y', new, new', p) -> 1 where no |u| is about to vanish."""
        arguments = self.drawn.mx_in()
        return SizedFunction("clear", arguments, [1 - ca.mmax(self.drawn(*arguments))])


def find(system: System) -> ForceSwitches | None:
    """The switches of a system; None where no force has one that depends on velocities."""
    # The forces that may jump in the velocities by their texts, with Q_j (n,).
    declared = named_functions.velocity_switches(system.model)
    s, p = system.symbols, system.p
    environment = Environment(system.model, s, FixedExponents(system.model))
    loads = [energy.generalized(force, environment) for force in declared]
    inputs = [s.t, s.q, s.v, p]
    unique: dict[int, ca.SX] = {}
    for Q in loads:
        ends = (each.argument for each in switches.among(Q, inputs))
        unique.update((end.element_hash(), end) for end in ends if end is not None)
    if not unique:
        return None
    every = ca.vertcat(*unique.values())
    u = every[np.flatnonzero(ca.which_depends(every, s.v, 1, True)).tolist()]
    if not u.numel():
        return None
    pattern = ca.jacobian_sparsity(u, s.v).T
    coordinates = tuple(tuple(pattern.row()[a:b]) for a, b in itertools.pairwise(pattern.colind()))
    n = s.q.numel()
    y, rate = ca.SX.sym("y", 2 * n + 1), ca.SX.sym("rate", 2 * n + 1)
    slope = ca.jtimes(u, ca.vertcat(s.t, s.q, s.v), ca.vertcat(1, rate[: 2 * n]))
    outputs = [ca.densify(x) for x in ca.substitute([u, slope], [s.q, s.v], [y[:n], y[n : 2 * n]])]
    rates = SizedFunction("rates", [s.t, y, rate, p], outputs)
    t, h, p = ca.SX.sym("t"), ca.SX.sym("h"), ca.SX.sym("p", p.numel())
    y, k, new, k_new = (ca.SX.sym(name, 2 * n + 1) for name in ("y", "k", "new", "k_new"))
    (u, slope), (u_new, slope_new) = rates(t, y, k, p), rates(t + h, new, k_new, p)
    reaches = ca.logic_and(u * slope <= 0, ca.fabs(u) <= h * ca.fabs(slope))
    drawn = ca.logic_and(reaches, u_new * slope_new < 0)
    watched = SizedFunction("drawn", [t, h, y, k, new, k_new, p], [drawn])
    Q = ca.vertcat(*loads)
    forces = SizedFunction("forces", inputs, [Q, operation_rules.roundings(Q, inputs)])
    return ForceSwitches(tuple(force.members.base for force in declared), coordinates, rates, watched, forces)


def at_contacts(system: System) -> tuple[list[int], ca.Function]:
    """The switches of contacts that depend on coordinates, then those of forces that depend on the state: the contact
    of each, K for forces; and (t, q, v, a, p) -> the switches, their rates, the sizes of their terms (U,)."""
    s, contacts, values = system.symbols, system.contacts, dict[tuple[int, int], ca.SX]()
    inputs = [s.t, s.q, s.v, system.p]
    for j in range(contacts.count + 1):
        state = s.q if j < contacts.count else ca.vertcat(s.q, s.v)
        value = contacts.g[j] if j < contacts.count else system.dynamics.h
        found = switches.compared(value, inputs)
        values.update({(j, u.element_hash()): u for u in found if ca.depends_on(u, state)})
    u = ca.densify(ca.vertcat(ca.SX(0, 1), *values.values()))
    rates = ca.jtimes(u, ca.vertcat(s.t, s.q, s.v), ca.vertcat(1, s.v, system.a))
    outputs = [u, ca.densify(rates), ca.densify(operation_rules.term_sizes(u, inputs))]
    function = SizedFunction("switch_rates", [s.t, s.q, s.v, system.a, system.p], outputs)
    return [j for j, _ in values], function
