"""The constraint rows in their order: holonomic, rigid, differential (D.5, D.6, D.7); those of contacts after them."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from lagcli.equations import family_rows
from lagcli.equations.environment import Environment
from lagcli.errors import diagnostics
from lagcli.frozen import frozen, frozen_value
from lagcli.model import model as nouns

if TYPE_CHECKING:
    from lagcli.equations.rigid import Geometry


@frozen_value
class Row:
    """A scalar row: its name, the constraint it belongs to, and where that stands."""

    name: str
    constraint: str
    location: diagnostics.Location


@frozen
class ConstraintRows:
    """f (s): holonomic and rigid rows; w (C): all rows as B v + b (D.6), the holonomic ones differentiated."""

    rows: tuple[Row, ...]
    f: ca.SX
    B: ca.SX
    b: ca.SX
    gamma: ca.SX


@frozen
class ContactRows:
    """g (K,) with its gradient G (K, n), dg/dt = G v + g_t and d2g/dt2 = G a - gamma; g_t, gamma (K,)."""

    rows: tuple[Row, ...]
    g: ca.SX
    G: ca.SX
    g_t: ca.SX
    gamma: ca.SX

    @property
    def count(self) -> int:
        return len(self.rows)


# Rows, and a block of them or their values.
_Rows = tuple[list[Row], family_rows.FamilyBlock | ca.SX]


def equalities(
    model: nouns.Model, environment: Environment, bodies: Sequence[tuple[Geometry, Sequence[ca.SX]]]
) -> ConstraintRows:
    """The rows of all equations. `bodies`: for each rigid body its geometry and the symbols of its constants. B (C, n),
    b, gamma (C) with B v + b = 0, B a = gamma. Raises `diagnostics.ModelError` for a row without coordinates."""
    holonomic = list(_of_laws(model.holonomic, environment))
    for body, (geometry, constants) in zip(model.rigid, bodies, strict=True):
        values = of_body(body, environment, geometry, constants)
        numbered = range(1, values.numel() + 1)
        rows = [Row(f"{body.name}.{i}", body.name, body.location) for i in numbered]
        holonomic.append((rows, values))
    names, blocks = _blocks(holonomic, environment, family_rows.holonomic)
    laws = _of_laws(model.differential, environment)
    more, others = _blocks(laws, environment, family_rows.differential)
    return _joined((*names, *more), [*blocks, *others], environment.q)


def contacts(model: nouns.Model, environment: Environment) -> ContactRows:
    """The rows of all inequalities. Raises `diagnostics.ModelError` for one without coordinates."""
    laws = _of_laws(model.inequality, environment)
    names, blocks = _blocks(laws, environment, family_rows.holonomic)
    found = _joined(tuple(names), blocks, environment.q)
    return ContactRows(found.rows, found.f, found.B, found.b, found.gamma)


def _joined(names: tuple[Row, ...], blocks: Sequence[family_rows.FamilyBlock], q: ca.SX) -> ConstraintRows:
    """The rows of all blocks. Raises `diagnostics.ModelError` for one without coordinates, but for a component 0 = 0 of
    a vector equation, which stays as a redundant row, and for g(q, t) dt = 0, which demands g = 0."""
    f, b, gamma = (
        ca.densify(ca.vertcat(ca.SX(0, 1), *(getattr(block, part) for block in blocks)))
        for part in ("f", "b", "gamma")
    )
    B = ca.sparsify(ca.vertcat(ca.SX(0, q.numel()), *(block.B for block in blocks)))
    s = f.numel()
    values = ca.vertcat(f, b[s:, :])
    filled = np.bincount(np.asarray(B.sparsity().row(), dtype=int), minlength=len(names))
    empty = [
        names[i]
        for i in np.flatnonzero(filled == 0).tolist()
        if not (names[i].name != names[i].constraint and values[i].is_zero())
        and not (i >= s and ca.jacobian(b[i], q).nnz())
    ]
    if empty:
        # Of a family the first says it for all: they are one text.
        empty = list({row.location: row for row in reversed(empty)}.values())[::-1]
        hint = "take it out, or name the coordinate it is about"
        raise diagnostics.ModelError(
            diagnostics.Diagnostic(
                "no-coordinates",
                f"no coordinate enters the constraint `{row.name}` with a slope: its gradient vanishes everywhere,"
                " so it cannot act on the motion",
                row.location,
                hint,
            )
            for row in empty
        )
    return ConstraintRows(names, f, B, b, gamma)


def with_contacts(rows: ConstraintRows, contacts: ContactRows, lam: ca.SX) -> ConstraintRows:
    """All rows in the order of the multipliers lam (C + K,): the equality rows, with their f, then the contacts. The
    row of an open contact is 0: its gradient may have no value where it is open."""
    if not contacts.count:
        return rows
    G = contacts.G
    acting = lam[(np.asarray(G.sparsity().row(), dtype=np.int64) + len(rows.rows)).tolist()]
    G = ca.SX(G.sparsity(), ca.if_else(ca.vec(acting) == 0, 0, ca.vec(G.nz[:])))
    return ConstraintRows(
        (*rows.rows, *contacts.rows),
        rows.f,
        ca.sparsify(ca.vertcat(rows.B, G)),
        ca.vertcat(rows.b, contacts.g_t),
        ca.vertcat(rows.gamma, contacts.gamma),
    )


def _of_laws(laws: Iterable[nouns.Law], environment: Environment) -> Iterator[_Rows]:
    """The rows of each law, those of one member after another, and what they are made of."""
    for law in laws:
        if law.members.count:
            each = 3 if not isinstance(law, nouns.Inequality) and law.is_vector else 1
            location, names = law.equation.location, law.members.names
            rows = [Row(name, names[k // each], location) for k, name in enumerate(law.rows)]
            block = family_rows.block(law, environment)
            yield rows, environment.equation(law) if block is None else block


def _blocks(
    entries: Iterable[_Rows],
    environment: Environment,
    build: Callable[[ca.SX, Environment], family_rows.FamilyBlock],
) -> tuple[list[Row], list[family_rows.FamilyBlock]]:
    """All rows in their order; `build` makes a block of the values of neighbours that cannot be mapped."""
    names: list[Row] = []
    blocks: list[family_rows.FamilyBlock] = []
    for _, group in itertools.groupby(entries, lambda entry: isinstance(entry[1], ca.SX)):
        values: list[ca.SX] = []
        for rows, made in group:
            names += rows
            if isinstance(made, ca.SX):
                values.append(made)
            else:
                blocks.append(made)
        if values:
            blocks.append(build(ca.densify(ca.vertcat(*values)), environment))
    return names, blocks


def of_body(
    body: nouns.RigidBody, environment: Environment, geometry: Geometry, constants: Sequence[ca.SX]
) -> ca.SX:
    """The rows f of a rigid body, (k, 1)."""
    columns = environment.position(np.array(body.particles))
    positions = list(zip(*(ca.vertsplit(part) for part in columns), strict=True))
    base = [positions[k] for k in geometry.base]
    rows = []
    for number, (i, j) in enumerate(geometry.pairs):
        square = sum((x - y) ** 2 for x, y in zip(base[i], base[j], strict=True))
        rows.append(ca.sqrt(square) - constants[number])
    rest = iter(constants[len(geometry.pairs) :])
    alpha = [[next(rest) for _ in base] for _ in geometry.further]
    normal = None
    if geometry.gamma.size:
        # (r_2 - r_1) x (r_3 - r_1)
        (a, b, c), (x, y, z) = ([p - q for p, q in zip(base[i], base[0], strict=True)] for i in (1, 2))
        normal = b * z - c * y, c * x - a * z, a * y - b * x
    for k, weights in zip(geometry.further, alpha, strict=True):
        height = next(rest) if normal is not None else None
        for axis in range(3):
            point = sum((w * r[axis] for w, r in zip(weights, base, strict=True)), ca.SX(0))
            if normal is not None and height is not None:
                point += height * normal[axis]
            rows.append(positions[k][axis] - point)
    found: ca.SX = ca.vertcat(*rows)
    return found
