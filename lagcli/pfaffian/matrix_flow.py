"""Linear differential equations among the forms: x' = A x + b(s) has the integrals exp(-A s) x - int exp(-A s) b ds."""

from __future__ import annotations

import sympy

from lagcli.pfaffian import kernel_frame as frames
from lagcli.pfaffian import potential
from lagcli.pfaffian.exact import guarded
from lagcli.pfaffian.exact.guarded import SympyFailure


def linear(frame: frames.KernelFrame, column: int) -> tuple[sympy.Expr, ...] | None:
    """The integrals (C,) of the field of free variable `column`; None unless its equations are linear with
    constant matrix.
    """
    s = frame.variables[frame.free[column]]
    x = sympy.Matrix([frame.variables[p] for p in frame.pivots])
    speeds = sympy.Matrix([guarded.expand(row[column]) for row in frame.solved])
    moving = {*x, s}
    A = speeds.jacobian(x)
    if any(e.free_symbols & moving for e in A):
        return None
    b = (speeds - A * x).applyfunc(guarded.expand)
    if any(e.free_symbols & set(x) for e in b):
        return None
    back = _exponential(A, -s)
    if back is None:
        return None
    drift = []
    for e in back * b:
        found = potential.antiderivative(guarded.expand(e), s)
        if found is None:
            return None
        drift.append(found)
    return tuple((_eigenrows(A) * (back * x - sympy.Matrix(drift))).applyfunc(guarded.expand))


def _eigenrows(A: sympy.Matrix) -> sympy.Matrix:
    """Rows l with l A = k l for all rational k, where there are enough of them; else the unit matrix."""
    rows = []
    if all(e.is_Rational for e in A):
        for value, _, vectors in guarded.call(A.T.eigenvects, error_when_incomplete=False):
            if value.is_Rational:
                scales = (sympy.ilcm(1, *(e.q for e in v)) for v in vectors)
                rows += [(v * scale).T for v, scale in zip(vectors, scales, strict=True)]
    return sympy.Matrix.vstack(*rows) if len(rows) == A.rows else sympy.eye(A.rows)


def _exponential(A: sympy.Matrix, s: sympy.Expr) -> sympy.Matrix | None:
    """exp(A s) in real functions, or None."""
    size = A.rows
    total, power = sympy.eye(size), sympy.eye(size)
    for n in range(1, size + 1):
        power = (power * A).applyfunc(guarded.expand)
        if power.is_zero_matrix:
            return total
        total += power * s**n / sympy.factorial(n)
    if size == 1:
        return sympy.Matrix([[sympy.exp(A[0] * s)]])
    if size == 2:
        # With A = h I + B, B**2 = q I: exp(A s) = exp(h s) (cosh(sqrt(q) s) I + sinh(sqrt(q) s)/sqrt(q) B)
        h = A.trace() / 2
        B = A - h * sympy.eye(2)
        q = guarded.factor(-B.det())
        if q == 0:
            even, odd = sympy.Integer(1), s
        elif q.is_negative or q.could_extract_minus_sign():
            w = _root(-q)
            even, odd = sympy.cos(w * s), sympy.sin(w * s) / w
        else:
            w = _root(q)
            even = (sympy.exp(w * s) + sympy.exp(-w * s)) / 2
            odd = (sympy.exp(w * s) - sympy.exp(-w * s)) / (2 * w)
        return (sympy.exp(h * s) * (even * sympy.eye(2) + odd * B)).applyfunc(guarded.expand)
    try:
        found = guarded.call((A * s).exp)
        found = found.applyfunc(lambda e: guarded.expand(e, complex=e.has(sympy.I)))
    except SympyFailure:
        return None
    return found if all(potential.writable(e) for e in found) else None


def _root(square: sympy.Expr) -> sympy.Expr:
    """sqrt(k**2) = k, of either sign: the functions of it are even."""
    root = sympy.sqrt(square)
    return root.replace(sympy.Abs, lambda u: u)
