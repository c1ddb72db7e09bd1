"""Integrals by reduction: a form in two variables is an ordinary differential equation; more variables are
reduced one by one (L. Natani, Die hoehere Analysis, 1866; A. Mayer, Math. Ann. 5, 1872).
"""

from collections.abc import Callable
from itertools import combinations

import sympy

from lagcli.pfaffian import form as forms
from lagcli.pfaffian.exact import guarded
from lagcli.pfaffian.single_form import potential, tidy_integral

Search = Callable[[forms.Form], sympy.Expr | None]

_HINTS = (
    "separable",
    "1st_exact",
    "1st_linear",
    "Bernoulli",
    "almost_linear",
    "1st_homogeneous_coeff_subs_dep_div_indep",
    "1st_homogeneous_coeff_subs_indep_div_dep",
    "linear_coefficients",
    "separable_reduced",
    "1st_rational_riccati",
)
_PAIRS = 3


def ordinary(form: forms.Form) -> sympy.Expr | None:
    """The integral of a form in two variables from SymPy's solver of first-order equations, or None."""
    for first, second in ((0, 1), (1, 0)):
        phi = _solved(form, first, second)
        if phi is not None:
            return phi
    return None


def _solved(form: forms.Form, first: int, second: int) -> sympy.Expr | None:
    """The constant C1 of the general solution of A_first + A_second dy/dx = 0."""
    x, y = form.variables[first], form.variables[second]
    if form.coefficients[second] == 0:
        return x
    function = sympy.Function("y_")(x)
    slope = tidy_integral.ratio(-form.coefficients[first], form.coefficients[second])
    equation = sympy.Eq(function.diff(x), guarded.subs(slope, y, function))
    try:
        hints = guarded.classify_ode(equation, function)
    except guarded.SympyFailure:
        return None
    for hint in (h for h in _HINTS if h in hints):
        try:
            solution = guarded.dsolve(equation, function, hint=hint, simplify=False)
        except guarded.SympyFailure:
            continue
        for each in solution if isinstance(solution, list) else [solution]:
            phi = _constant(each, function, y)
            if phi is not None:
                return phi
    return None


def _constant(solution: sympy.Eq, function: sympy.Expr, y: sympy.Symbol) -> sympy.Expr | None:
    if not isinstance(solution, sympy.Eq):
        return None
    c1 = sympy.Symbol("C1")
    relation = guarded.subs(guarded.call((solution.lhs - solution.rhs).doit), function, y)
    if not potential.writable(relation) or c1 not in relation.free_symbols:
        return None
    try:
        found = guarded.solve(relation, c1)
    except guarded.SympyFailure:
        return None
    good = [phi for phi in found if potential.writable(phi) and phi.free_symbols]
    return good[0] if good else None


def natani(form: forms.Form, search: Search) -> sympy.Expr | None:
    """The integral of an integrable form in three or more variables.

    With all but two variables held fixed, `search` finds u(a, b). Then omega/sigma = du + sum K_l dx_l,
    where the K_l depend on u and the held variables only: a form with one variable less.
    """
    pairs = [
        (i, j)
        for i, j in combinations(range(len(form.variables)), 2)
        if form.coefficients[i] != 0 and form.coefficients[j] != 0
    ]
    pairs.sort(key=lambda p: form.coefficients[p[0]].count_ops() + form.coefficients[p[1]].count_ops())
    for i, j in pairs[:_PAIRS]:
        phi = _reduced(form, i, j, search)
        if phi is not None:
            return phi
    return None


def _reduced(form: forms.Form, i: int, j: int, search: Search) -> sympy.Expr | None:
    x, a = form.variables, form.coefficients
    held = [n for n in range(len(x)) if n not in (i, j)]
    parameters = (*form.parameters, *(x[n] for n in held))
    u = search(forms.Form(form.name, (x[i], x[j]), (a[i], a[j]), parameters))
    if u is None:
        return None
    sigma = (
        tidy_integral.ratio(a[i], forms.partial(u, x[i]))
        if u.has(x[i])
        else tidy_integral.ratio(a[j], forms.partial(u, x[j]))
    )
    rest = [tidy_integral.shortest(tidy_integral.ratio(a[n], sigma) - forms.partial(u, x[n])) for n in held]
    letter = sympy.Symbol("u_", real=True)
    rest_in_u = _in_terms_of(rest, u, letter, (x[i], x[j]))
    if rest_in_u is None:
        return None
    if all(k == 0 for k in rest_in_u):
        return u
    smaller = forms.Form(
        form.name, (letter, *(x[n] for n in held)), (sympy.Integer(1), *rest_in_u), form.parameters
    )
    phi = search(smaller)
    return None if phi is None else guarded.subs(phi, letter, u)


def _in_terms_of(
    rest: list[sympy.Expr], u: sympy.Expr, letter: sympy.Symbol, pair: tuple[sympy.Symbol, sympy.Symbol]
) -> list[sympy.Expr] | None:
    """The expressions, known to depend on the pair only through u, as functions of the letter for u."""
    if not any(k.free_symbols & set(pair) for k in rest):
        return rest
    for gone, solved in (pair, pair[::-1]):
        for value in (1, 0, 2):
            try:
                roots = guarded.solve(guarded.subs(u, gone, value) - letter, solved)
            except guarded.SympyFailure:
                continue
            for root in roots if isinstance(roots, list) else []:
                fixed = [guarded.subs(k, gone, value) for k in rest]
                written = [tidy_integral.shortest(guarded.subs(k, solved, root)) for k in fixed]
                if all(potential.writable(k) and not k.free_symbols & set(pair) for k in written):
                    return written
    return None
