"""The rows of a family: its law is differentiated once, for a member that stands for all, and mapped over them.

The coordinates that a member touches become symbols of its own, with a table of their rows of q for each member.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from lagcli.arrays import Integers
from lagcli.equations.environment import Environment, Triple, Value, rate, scattered
from lagcli.expression import evaluate, tree
from lagcli.frozen import frozen
from lagcli.model import model as nouns
from lagcli.smoothness.sized_function import SizedFunction

# Below this number of members the detour costs more than it saves.
WORTH = 4


class NotMappable(Exception):
    """The members cannot be mapped: what they touch is a function of many coordinates, or differs in form."""


@frozen
class FamilyBlock:
    """Rows of one law, those of one member after another: f (C,) or nothing, B (C, n), b (C,), gamma (C,)."""

    f: ca.SX
    B: ca.SX
    b: ca.SX
    gamma: ca.SX


def block(law: nouns.Law, environment: Environment) -> FamilyBlock | None:
    """The rows of a law, or None where they are better built over columns."""
    count, relation = law.members.count, law.equation.tree
    assert isinstance(relation, tree.Relation)
    # An exponent is built in, and must then be the same for all members.
    powers = (node for node in tree.walk(relation) if isinstance(node, tree.Power))
    indices = law.members.variables.keys()
    if count < WORTH or any(tree.names(node.exponent) & indices for node in powers):
        return None
    leaves = MemberLeaves(environment)
    try:
        algebra = environment.algebra(law.members.variables, leaves=leaves)
        values = evaluate.difference(relation, algebra)
    except NotMappable:
        return None
    build = differential if isinstance(law, nouns.Differential) else holonomic
    one = build(ca.densify(ca.vertcat(*values)), leaves)
    mapped = leaves.mapped([one.f, ca.vec(one.B.nz[:]), one.b, one.gamma], count)
    f, entries, b, gamma = (ca.vec(output) for output in mapped)
    # The entries of all members, in each those of the pattern of one, to the rows of q that its table names.
    pattern, table, n = one.B.sparsity(), leaves.table(count), environment.q.numel()
    rows, columns = (np.asarray(part, dtype=np.int64) for part in pattern.get_triplet())
    height = pattern.size1() * count
    row = (np.arange(count)[:, None] * pattern.size1() + rows).ravel()
    # By columns, as matrices are stored; one coordinate may be touched twice by a member.
    index, number = np.unique(table[columns].T.ravel() * height + row, return_inverse=True)
    if index.size == number.size:
        placed = entries[np.argsort(number).tolist()] if number.size else entries
    else:
        placed = scattered(entries, number, index.size)
    sparsity = ca.Sparsity.triplet(height, n, (index % height).tolist(), (index // height).tolist())
    return FamilyBlock(f, ca.SX(sparsity, placed), b, gamma)


def holonomic(f: ca.SX, leaves: Environment | MemberLeaves) -> FamilyBlock:
    """Rows f = 0 (D.2), differentiated: B = df/dq, b = df/dt (D.6, D.7)."""
    B, b = ca.jacobian(f, leaves.q), ca.jtimes(f, leaves.t, ca.SX(1))
    return FamilyBlock(f, B, ca.densify(b), ca.densify(-leaves.rate(leaves.rate(f))))


def differential(value: ca.SX, leaves: Environment | MemberLeaves) -> FamilyBlock:
    """Rows B v + b = 0 given as they are, `value` = B v + b (D.3, D.4)."""
    v = leaves.v
    B, b = ca.jacobian(value, v), ca.substitute(value, v, ca.SX.zeros(v.shape))
    return FamilyBlock(ca.SX(0, 1), B, ca.densify(b), ca.densify(-leaves.rate(value)))


class MemberLeaves:
    """The leaves of one law as symbols of a single member. Raises `NotMappable` for dependent particles."""

    def __init__(self, environment: Environment) -> None:
        self._environment, self.t = environment, environment.t
        self._indices: dict[bytes, int] = {}
        self._rows: list[Integers] = []
        self._u: list[ca.SX] = []
        self._w: list[ca.SX] = []
        self._c: dict[str, ca.SX] = {}
        self._columns: list[ca.DM] = []

    @property
    def q(self) -> ca.SX:
        """The coordinates a member touches, (m, 1)."""
        return ca.vertcat(ca.SX(0, 1), *self._u)

    @property
    def v(self) -> ca.SX:
        """Their rates, (m, 1)."""
        return ca.vertcat(ca.SX(0, 1), *self._w)

    def table(self, count: int) -> Integers:
        """The row in q of each coordinate for each member, (m, K)."""
        rows = [np.broadcast_to(rows, count) for rows in self._rows]
        return np.array(rows, dtype=np.int64).reshape(-1, count)

    def constant(self, name: str) -> Value | None:
        return self._environment.constant(name)

    def position(self, numbers: Integers) -> Triple:
        return self._components(numbers, self._u)

    def velocity(self, numbers: Integers) -> Triple:
        return self._components(numbers, self._w)

    def generalized(self, numbers: Integers, rates: bool) -> ca.SX:
        index = self._index(self._environment.first_generalized + numbers)
        return (self._w if rates else self._u)[index]

    def variable(self, name: str, values: Integers) -> ca.SX:
        if name not in self._c:
            self._c[name] = ca.SX.sym(f"index {name}")
            self._columns.append(ca.DM(values.astype(float)).T)
        return self._c[name]

    def definition(self, name: str) -> Value:
        return evaluate.value(
            self._environment.names.definitions[name], self._environment.algebra(leaves=self)
        )

    def rate(self, value: ca.SX) -> ca.SX:
        return rate(value, self.q, self.v, self.t)

    differential = rate

    def mapped(self, outputs: list[ca.SX], count: int) -> list[ca.SX]:
        """Dense outputs (k,) of one member as (k, K) over all members."""
        s, table = self._environment.symbols, self.table(count)
        q, v, indices = self.q, self.v, ca.vertcat(ca.SX(0, 1), *self._c.values())
        own = {symbol.name() for symbol in ca.symvar(ca.vertcat(q, v, indices))}
        others = [x for x in ca.symvar(ca.vertcat(*outputs)) if x.name() not in own]
        shared = ca.vertcat(ca.SX(0, 1), *others)
        one = SizedFunction("law", [q, v, indices, shared], outputs, {"cse": True})
        flat = table.ravel(order="F").tolist()
        arguments = [ca.reshape(vector[flat], *table.shape) for vector in (s.q, s.v)]
        columns = ca.vertcat(ca.DM(0, count), *self._columns)
        return list(one.call([*arguments, ca.SX(columns), ca.repmat(shared, 1, count)]))

    def _components(self, numbers: Integers, vector: list[ca.SX]) -> Triple:
        if self._environment.is_dependent[numbers].any():
            raise NotMappable
        first = self._environment.rows_of(numbers)
        x, y, z = (self._index(first + axis) for axis in range(3))
        return vector[x], vector[y], vector[z]

    def _index(self, rows: Integers) -> int:
        """The index of a coordinate among u, by its rows in q, (1,) or (K,)."""
        index = self._indices.setdefault(rows.tobytes(), len(self._rows))
        if index == len(self._rows):
            self._rows.append(rows)
            self._u.append(ca.SX.sym(f"q {index}"))
            self._w.append(ca.SX.sym(f"v {index}"))
        return index
