"""Forms that differ in the names of their coordinates alone: one verdict serves them all.

The members of a family of laws are such forms. What is found for the first is told of the others in their names.
"""

import dataclasses
import re

import sympy

from lagcli.pfaffian.forms.form import Form
from lagcli.pfaffian.single_form import frobenius
from lagcli.pfaffian.single_form.frobenius import FormVerdict

Pattern = tuple[tuple[sympy.Expr, ...], tuple[sympy.Symbol, ...]]


class VerdictMemo:
    """Classifies forms, each kind of them once."""

    def __init__(self) -> None:
        self._places: list[sympy.Symbol] = []
        self._known: dict[Pattern, tuple[Form, FormVerdict]] = {}

    def classify(self, form: Form, deadline: float) -> FormVerdict:
        """As `frobenius.classify`."""
        pattern = self._pattern(form)
        known = self._known.get(pattern)
        if known is not None and _is_tellable(known[0], form):
            return _told(known[1], known[0], form)
        verdict = frobenius.classify(form, deadline)
        self._known.setdefault(pattern, (form, verdict))
        return verdict

    def _pattern(self, form: Form) -> Pattern:
        """The form with its coordinates numbered instead of named."""
        for n in range(len(self._places), len(form.variables)):
            self._places.append(sympy.Dummy(f"x{n}", real=True))
        numbered = dict(zip(form.variables, self._places, strict=False))
        return tuple(a.xreplace(numbered) for a in form.coefficients), form.parameters


def _is_tellable(known: Form, form: Form) -> bool:
    """True if every name that differs is that of a member, `x[1]`: it is then told from words in a sentence."""
    pairs = zip(known.variables, form.variables, strict=True)
    return all(x == y or "[" in x.name for x, y in pairs)


def _told(verdict: FormVerdict, known: Form, form: Form) -> FormVerdict:
    """The verdict of `known` in the names of `form`."""
    renamed = dict(zip(known.variables, form.variables, strict=True))

    def turn(expression: sympy.Expr | None) -> sympy.Expr | None:
        return None if expression is None else expression.xreplace(renamed)

    names = {x.name: y.name for x, y in renamed.items() if x != y}
    longest_first = sorted(map(re.escape, names), key=len, reverse=True)
    written = re.compile(rf"(?<!\w)(?:{'|'.join(longest_first)})(?!\w)") if names else None
    method = verdict.method if written is None else written.sub(lambda m: names[m[0]], verdict.method)
    witness = verdict.witness
    if witness is not None:
        i, j, k = (renamed[x] for x in witness.variables)
        component, value = witness.component.xreplace(renamed), witness.value
        if value is not None:
            point = tuple((names.get(name, name), number) for name, number in value.point)
            value = dataclasses.replace(value, point=point)
        witness = frobenius.FrobeniusWitness((i, j, k), component, value)
    return dataclasses.replace(
        verdict,
        integral=turn(verdict.integral),
        integrating_factor=turn(verdict.integrating_factor),
        method=method,
        witness=witness,
        special=tuple(e.xreplace(renamed) for e in verdict.special),
    )
