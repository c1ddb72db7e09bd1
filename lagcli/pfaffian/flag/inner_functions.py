"""Arguments of functions and roots on a surface: sqrt(x**2 + y**2) is 1 where x**2 + y**2 = 1.

To the algebra of `tower` a function of an argument is a letter of its own, whatever the surface says of the argument.
So arguments that are constant on the surface are first replaced by their constants.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import sympy

from lagcli.pfaffian.exact import guarded
from lagcli.pfaffian.exact.guarded import SympyFailure
from lagcli.pfaffian.forms.pfaffian_block import PfaffianBlock

_KINDS = (sympy.Function, sympy.Pow)


def plain(block: PfaffianBlock) -> PfaffianBlock:
    """The block with the arguments in its rows that are constant on the polynomial part of its surface replaced."""
    held = [f for f in block.surface if f.is_polynomial(*block.variables)]
    moving = {x for f in held for x in f.free_symbols & set(block.variables)}
    if not moving or not any(a.has(*_KINDS) for row in block.rows for a in row):
        return block
    variables = [x for x in block.variables if x in moving]
    known: dict[sympy.Expr, sympy.Expr] = {}
    ideal: list[sympy.GroebnerBasis] = []

    def constant(u: sympy.Expr) -> sympy.Expr:
        """The argument, or what it is on the whole surface."""
        if not u.free_symbols & moving or not u.is_polynomial(*variables):
            return u
        if u not in known:
            try:
                if not ideal:
                    ideal.append(guarded.groebner(held, *variables, order="grevlex"))
                rest = guarded.call(ideal[0].reduce, guarded.expand(u))[1]
            except SympyFailure:  # roots of parameters that are no field of constants
                rest = u
            known[u] = u if rest.free_symbols & moving else guarded.expand(rest)
        return known[u]

    def replaced(e: sympy.Expr) -> sympy.Expr:
        if not e.args or not e.free_symbols & moving:
            return e
        is_inner = isinstance(e, sympy.Function) or (e.is_Pow and not e.exp.is_Integer)
        parts = [replaced(a) for a in e.args]
        if is_inner:
            parts = [constant(a) for a in parts]
        return e if tuple(parts) == e.args else e.func(*parts)

    rows: Sequence[tuple[sympy.Expr, ...]] = tuple(tuple(replaced(a) for a in row) for row in block.rows)
    return dataclasses.replace(block, rows=tuple(rows))
