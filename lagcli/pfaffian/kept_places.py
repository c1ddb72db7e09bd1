"""Whether motions from a start keep to a place e = 0, by algebra alone.

A motion along the fields X of D = ker I keeps to e = 0 where e and all its derivatives X(e), X(Y(e)), ... vanish at the
start: rows are analytic. On e = 0 the X(e) may vanish identically, and then it is kept; one that does not vanish at the
start leads away; else the place where they vanish too is looked at in its turn.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import sympy

from lagcli.pfaffian import special_points
from lagcli.pfaffian.exact import guarded, normal_form
from lagcli.pfaffian.forms import form as forms
from lagcli.pfaffian.forms.form import PfaffianBlock
from lagcli.pfaffian.function_field import FunctionField, NotDecidedError

# Derivatives of derivatives: a place of more generations is left open.
GENERATIONS = 8


def kept(
    block: PfaffianBlock,
    equations: Sequence[sympy.Expr],
    rank: int | None,
    vanishes: Callable[[sympy.Expr], bool],
    deadline: float,
) -> tuple[sympy.Expr, ...]:
    """All equations that follow for the motions from a start on a place, or none where they leave it.

    equations: of the place, the last of which is in question, while the others hold on the motions; rank: that of all
    rows of the block, its surface among them, where the others hold, None if it is not known; vanishes: whether an
    expression does at the start. Raises `NotDecidedError` where the rows that are independent at the start are fewer
    and do not keep to the place by themselves, and where algebra comes to no end.
    """
    all_of_them, new = [*equations], [equations[-1]]
    for _ in range(GENERATIONS):
        try:
            slopes, independent = _slopes(block, all_of_them, new, vanishes, deadline)
        except guarded.NoAnswerError as error:
            raise NotDecidedError(str(error)) from error
        if not slopes:
            return tuple(all_of_them)
        if independent != rank:
            raise NotDecidedError("the rows have another rank at the start than beside it")
        if not all(map(vanishes, slopes)):
            return ()
        new = [_own(e, vanishes) for e in special_points.distinct(slopes)]
        all_of_them += new
    raise NotDecidedError("the places on which motions from the start stay have no end that algebra sees")


def _slopes(
    block: PfaffianBlock,
    equations: Sequence[sympy.Expr],
    new: Sequence[sympy.Expr],
    vanishes: Callable[[sympy.Expr], bool],
    deadline: float,
) -> tuple[list[sympy.Expr], int]:
    """The X(e) of the new ones among equations, without those that vanish where all equations hold, X being the fields
    of the rows that are independent at the start; and how many these are."""
    there = dataclasses.replace(block, surface=(*block.surface, *equations))
    field = FunctionField(there, deadline, {})
    rows = field.rows([*field.gradients[: len(block.surface)], *block.rows])
    solved = field.solved(rows, vanishes=vanishes)
    gradients = field.rows([forms.partial(e, x) for x in block.variables] for e in new)
    frame = field.frame(solved)
    found = [field.sum(zip(X, gradient, strict=True)) for X in frame for gradient in gradients]
    if any(vanishes(field.expression(a.denom)) for a in found):
        raise NotDecidedError("a place has no differential at the start")
    return [field.expression(a.numer) for a in found if a], solved.count


def vanishing(block: PfaffianBlock, equations: Sequence[sympy.Expr]) -> frozenset[str]:
    """The rows that vanish on a place. Raises `NotDecidedError`."""
    rows = [[forms.plain(a) for a in row] for row in block.rows]
    try:
        basis = normal_form.NormalForm([a for row in rows for a in row], (*block.surface, *equations))
        found = [not any(map(basis.element, row)) for row in rows]
    except guarded.NoAnswerError as error:
        raise NotDecidedError(str(error)) from error
    return frozenset(name for name, is_nothing in zip(block.names, found, strict=True) if is_nothing)


def _own(expression: sympy.Expr, vanishes: Callable[[sympy.Expr], bool]) -> sympy.Expr:
    """The factors that vanish at the start, each once: they say all that the expression does around it."""
    return special_points.product(e for e in special_points.factors(expression) if vanishes(e))
