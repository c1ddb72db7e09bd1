"""First integrals of a completely integrable Pfaffian system (D.3, for rows that are holonomic jointly).

By the theorem of Frobenius C such forms in n variables have C functionally independent integrals phi_a, whose
differentials span the forms. They are sought "by some hook or crook", cheap ways first; each one counts only
when X(phi) = 0 is proved for every field of a frame of the kernel, and all together only when they are proved
independent.
"""

from __future__ import annotations

import sympy

from lagcli.pfaffian import elimination, guesses, integral_search
from lagcli.pfaffian.exact import guarded, time_limit
from lagcli.pfaffian.forms import form as forms

Found = integral_search.SearchResult

_WAYS: integral_search.Ways = (
    (guesses.fixed, 40_000),
    (guesses.polynomials, 80_000),
    (guesses.products, 80_000),
    (guesses.rational, 40_000),
    (guesses.turned, 60_000),
    (guesses.linear_flow, 80_000),
    (guesses.invariant_surfaces, 60_000),
    (guesses.eliminations, 120_000),
    (guesses.one_form, 120_000),
    (guesses.single_rows, 80_000),
    (guesses.eliminations, 120_000),
)
"""Ways of searching, cheap ones first, and the operations that each may take."""


def search(
    block: forms.PfaffianBlock, deadline: float, wanted: int | None = None, budget: int | None = None
) -> tuple[Found, ...]:
    """Verified and independent first integrals of the rows (C, n), at most C; ends at `deadline`.

    The rows are completely integrable, on the surface of the block where it has one; the deadline is one of
    `progress.after`. Fewer than C, or none, where no closed form was found. Where the rows are not completely
    integrable, `wanted` tells how many integrals there are. `budget`: of operations for all ways together.
    """
    real = {s: sympy.Symbol(s.name, real=True) for s in (*block.variables, *block.parameters)}
    back_to_callers = {r: s for s, r in real.items()}
    try:
        flat = time_limit.run(deadline, lambda: elimination.eliminated(_renamed(block, real))[0])
        plain, from_angles = time_limit.run(deadline, lambda: elimination.in_angles(flat))
    except time_limit.NO_ANSWER:
        return ()
    found = integral_search.found_by(plain, _WAYS, deadline, wanted, budget)
    return tuple(Found(_put_back(f.integral, from_angles).xreplace(back_to_callers), f.how) for f in found)


def _renamed(block: forms.PfaffianBlock, names: dict[sympy.Symbol, sympy.Symbol]) -> forms.PfaffianBlock:
    def turn(e: sympy.Expr) -> sympy.Expr:
        return forms.plain(sympy.sympify(e).xreplace(names))

    return forms.PfaffianBlock(
        block.names,
        tuple(names[x] for x in block.variables),
        tuple(tuple(turn(a) for a in row) for row in block.rows),
        tuple(names[p] for p in block.parameters),
        tuple(turn(f) for f in block.surface),
    )


def _put_back(phi: sympy.Expr, angles: elimination.Substitutions) -> sympy.Expr:
    """phi with the coordinates of circles instead of their angles."""
    if not phi.free_symbols & angles.keys():
        return phi
    plain = guarded.expand_trig(phi)
    outer = {e: value for e, value in angles.items() if not e.is_Symbol}
    return plain.xreplace(outer).xreplace(angles)
