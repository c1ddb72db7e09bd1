"""Numbers below which no gap is while the state stays in a box: interval arithmetic, written out as a function.

R. E. Moore, Interval Analysis (1966). An operation that is not known here says nothing of the gaps made with it.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import casadi as ca

from lagcli.compiled.parts import Parts

# Below and above; None where nothing is known.
Span = tuple[ca.SX, ca.SX]
Known = Span | None

# Functions that rise everywhere.
RISING = {ca.OP_EXP, ca.OP_TANH, ca.OP_ATAN, ca.OP_SINH, ca.OP_ASINH, ca.OP_ERF}
MOST_POWER = 16


def function(parts: Parts) -> ca.Function:
    """floors(t_low, t_high, q_low, q_high, p) -> (K,); where nothing is known, below zero or not a number."""
    n = parts.v.numel()
    value = ca.Function("gaps", [parts.t, parts.y[:n], parts.p], [ca.densify(parts.contacts.g)])
    t_low, t_high = ca.SX.sym("t_low"), ca.SX.sym("t_high")
    low, high, p = ca.SX.sym("q_low", n), ca.SX.sym("q_high", n), ca.SX.sym("p", parts.p.numel())
    q_spans = list(zip(ca.vertsplit(low), ca.vertsplit(high), strict=True)) if n else []
    given = [[(t_low, t_high)], q_spans, [(x, x) for x in ca.vertsplit(p)] if p.numel() else []]
    work: dict[int, Known] = {}
    floors = [ca.SX(-1)] * parts.contacts.count
    for k in range(value.n_instructions()):
        op, taken, made = value.instruction_id(k), value.instruction_input(k), value.instruction_output(k)
        if op == ca.OP_OUTPUT:
            found = work[taken[0]]
            floors[made[1]] = ca.SX(-1) if found is None else found[0]
        elif op == ca.OP_INPUT:
            work[made[0]] = given[taken[0]][taken[1]]
        elif op == ca.OP_CONST:
            x = ca.SX(value.instruction_constant(k))
            work[made[0]] = x, x
        else:
            work[made[0]] = _of(op, [work[place] for place in taken], taken)
    return ca.Function("floors", [t_low, t_high, low, high, p], [ca.vertcat(ca.SX(0, 1), *floors)])


def _of(op: int, spans: list[Known], places: list[int]) -> Known:
    """The span of an operation on others, by their places: of one and the same there is no span of its own."""
    known = [span for span in spans if span is not None]
    if len(known) < len(spans):
        return None
    if op == ca.OP_MUL and places[0] == places[-1]:
        op, known = ca.OP_SQ, known[:1]
    if op in RISING:
        (a,) = known
        return ca.SX.unary(op, a[0]), ca.SX.unary(op, a[1])
    if op in (ca.OP_POW, ca.OP_CONSTPOW):
        return _power(*known)
    rule = _RULES.get(op)
    return None if rule is None else rule(*known)


def _times(a: Span, b: Span) -> Span:
    if _is_one(b):
        a, b = b, a
    if _is_one(a):
        x, y = a[0] * b[0], a[0] * b[1]
        return ca.fmin(x, y), ca.fmax(x, y)
    w, x, y, z = (i * j for i, j in itertools.product(a, b))
    return ca.fmin(ca.fmin(w, x), ca.fmin(y, z)), ca.fmax(ca.fmax(w, x), ca.fmax(y, z))


def _is_one(a: Span) -> bool:
    """True for one number in place of a span."""
    return bool(ca.is_equal(a[0], a[1]))


def _inverse(b: Span) -> Span:
    # A divisor that may be zero leaves no number.
    apart = b[0] * b[1] > 0
    nothing = ca.SX.nan()
    return ca.if_else(apart, 1 / b[1], nothing), ca.if_else(apart, 1 / b[0], nothing)


def _sizes(a: Span) -> Span:
    return ca.fmax(ca.fmax(a[0], -a[1]), 0), ca.fmax(-a[0], a[1])


def _square(a: Span) -> Span:
    low, high = _sizes(a)
    return low * low, high * high


def _power(a: Span, b: Span) -> Known:
    exponent = float(b[0]) if b[0].is_constant() and _is_one(b) else 0.5
    if exponent != int(exponent) or not 1 <= exponent <= MOST_POWER:
        return None
    low, high = a if exponent % 2 else _sizes(a)
    return low ** int(exponent), high ** int(exponent)


def _wave(of: Callable[[ca.SX], ca.SX], a: Span) -> Span:
    """A sine or cosine: no farther from its value in the middle than the argument is."""
    value, reach = of((a[0] + a[1]) / 2), (a[1] - a[0]) / 2
    return ca.fmax(value - reach, -1), ca.fmin(value + reach, 1)


_RULES: dict[int, Callable[..., Known]] = {
    ca.OP_ADD: lambda a, b: (a[0] + b[0], a[1] + b[1]),
    ca.OP_SUB: lambda a, b: (a[0] - b[1], a[1] - b[0]),
    ca.OP_NEG: lambda a: (-a[1], -a[0]),
    ca.OP_MUL: _times,
    ca.OP_TWICE: lambda a: (2 * a[0], 2 * a[1]),
    ca.OP_DIV: lambda a, b: _times(a, _inverse(b)),
    ca.OP_INV: _inverse,
    ca.OP_SQ: _square,
    ca.OP_SQRT: lambda a: (ca.sqrt(ca.fmax(a[0], 0)), ca.sqrt(ca.fmax(a[1], 0))),
    ca.OP_FABS: _sizes,
    ca.OP_FMIN: lambda a, b: (ca.fmin(a[0], b[0]), ca.fmin(a[1], b[1])),
    ca.OP_FMAX: lambda a, b: (ca.fmax(a[0], b[0]), ca.fmax(a[1], b[1])),
    ca.OP_SIN: lambda a: _wave(ca.sin, a),
    ca.OP_COS: lambda a: _wave(ca.cos, a),
}
