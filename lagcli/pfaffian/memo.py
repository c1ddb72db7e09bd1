"""Forms and blocks that differ in the names of their coordinates alone: what is found for the first holds for all.

The members of a family of laws are such forms.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable, Sequence

import sympy

from lagcli.memory import Memory
from lagcli.pfaffian import frobenius, joint
from lagcli.pfaffian.forms.form import Form, PfaffianBlock
from lagcli.pfaffian.frobenius import FormVerdict
from lagcli.pfaffian.function_field import Values
from lagcli.pfaffian.joint import Flagged, JointIntegral, Solution

# The coefficients and parameters of a form whose coordinates are numbered.
_FormPattern = tuple[tuple[sympy.Expr, ...], tuple[sympy.Symbol, ...]]
# The rows, surface and parameters of a block whose coordinates are numbered.
_BlockPattern = tuple[tuple[tuple[sympy.Expr, ...], ...], tuple[sympy.Expr, ...], tuple[sympy.Symbol, ...]]


class _Numbering:
    """Symbols for the coordinates of a form or block by their numbers."""

    def __init__(self) -> None:
        self._placeholders: list[sympy.Symbol] = []

    def of(self, variables: Sequence[sympy.Symbol]) -> dict[sympy.Symbol, sympy.Symbol]:
        """The symbol of each coordinate."""
        for n in range(len(self._placeholders), len(variables)):
            self._placeholders.append(sympy.Dummy(f"x{n}", real=True))
        return dict(zip(variables, self._placeholders, strict=False))


class VerdictMemo:
    """Classifies forms, each kind of them once."""

    def __init__(self) -> None:
        self._numbering = _Numbering()
        self._memory = Memory()

    def classify(self, form: Form, deadline: float) -> FormVerdict:
        """Classify as `frobenius.classify` does."""
        pattern = self._pattern(form)
        known, verdict = self._memory.answer(pattern, lambda: (form, frobenius.classify(form, deadline)))
        if known is form:
            return verdict
        if _is_renamable(known, form):
            return _renamed(verdict, known, form)
        return frobenius.classify(form, deadline)

    def _pattern(self, form: Form) -> _FormPattern:
        """The form with its coordinates numbered instead of named."""
        numbered = self._numbering.of(form.variables)
        return tuple(a.xreplace(numbered) for a in form.coefficients), form.parameters


def _is_renamable(known: Form, form: Form) -> bool:
    """True if every name that differs is that of a member, `x[1]`: it is then told from words in a sentence."""
    pairs = zip(known.variables, form.variables, strict=True)
    return all(x == y or "[" in x.name for x, y in pairs)


def _renamed(verdict: FormVerdict, known: Form, form: Form) -> FormVerdict:
    """The verdict of `known` in the names of `form`."""
    renamed = dict(zip(known.variables, form.variables, strict=True))
    moved = verdict.in_symbols(renamed)
    names = {x.name: y.name for x, y in renamed.items() if x != y}
    if not names:
        return moved
    longest_first = sorted(map(re.escape, names), key=len, reverse=True)
    written = re.compile(rf"(?<!\w)(?:{'|'.join(longest_first)})(?!\w)")
    moved = dataclasses.replace(moved, method=written.sub(lambda m: names[m[0]], verdict.method))
    witness = moved.witness
    if witness is None or witness.value is None:
        return moved
    point = tuple((names.get(name, name), number) for name, number in witness.value.point)
    value = dataclasses.replace(witness.value, point=point)
    return dataclasses.replace(moved, witness=dataclasses.replace(witness, value=value))


class JointMemo:
    """Flags and first integrals of blocks, each kind of them once: those that differ in names alone are renamed."""

    def __init__(self) -> None:
        self._numbering = _Numbering()
        self._memory = Memory()

    def flagged(self, block: PfaffianBlock, time: sympy.Symbol, values: Values, deadline: float) -> Flagged:
        """Find the flag as `joint.flagged` does."""
        known, found = self._memory.answer(
            ("flag", self._pattern(block)), lambda: (block, joint.flagged(block, time, values, deadline))
        )
        return found if known is block else _Renaming(known, block).flagged(found)

    def solution(
        self,
        block: PfaffianBlock,
        found: Flagged,
        verdicts: Sequence[frobenius.FormVerdict | None],
        deadline: float,
    ) -> Solution:
        """Solve as `joint.solution` does, with the `found` flag of the block."""
        known, solved = self._memory.answer(
            ("solution", self._pattern(block)), lambda: (block, joint.solution(found, verdicts, deadline))
        )
        return solved if known is block else _Renaming(known, block).solution(solved)

    def _pattern(self, block: PfaffianBlock) -> _BlockPattern:
        """The block with its coordinates numbered instead of named."""
        numbered = self._numbering.of(block.variables)
        rows = tuple(tuple(a.xreplace(numbered) for a in row) for row in block.rows)
        return rows, tuple(f.xreplace(numbered) for f in block.surface), block.parameters


class _Renaming:
    """From one block to another that differs in the names of its coordinates and rows alone."""

    def __init__(self, known: PfaffianBlock, block: PfaffianBlock) -> None:
        self._rows = dict(zip(known.names, block.names, strict=True))
        self._symbols = dict(zip(known.variables, block.variables, strict=True))
        self._symbols |= {joint.differential(x): joint.differential(y) for x, y in self._symbols.items()}

    def flagged(self, found: Flagged) -> Flagged:
        block, flag = found.block, found.flag
        variables = tuple(self._symbols[x] for x in block.variables)
        surface = self._each(block.surface)
        moved = PfaffianBlock(
            self._names(block.names), variables, self._table(block.rows), block.parameters, surface
        )
        values = {self._symbols[x]: value.xreplace(self._symbols) for x, value in found.values.items()}
        divisors = tuple(e if e is None else e.xreplace(self._symbols) for e in flag.divisors)
        flag = dataclasses.replace(
            flag,
            integrable=self._table(flag.integrable),
            special=self._each(flag.special),
            divisors=divisors,
            conditions=tuple(
                dataclasses.replace(one, factors=self._each(one.factors)) for one in flag.conditions
            ),
        )
        return Flagged(moved, values, flag)

    def solution(self, found: Solution) -> Solution:
        integrals = (
            JointIntegral(one.phi.xreplace(self._symbols), self._names(one.rows)) for one in found.integrals
        )
        return Solution(tuple(integrals), self._each(found.unsolved))

    def _names(self, names: Iterable[str]) -> tuple[str, ...]:
        return tuple(self._rows[name] for name in names)

    def _each(self, expressions: Iterable[sympy.Expr]) -> tuple[sympy.Expr, ...]:
        return tuple(e.xreplace(self._symbols) for e in expressions)

    def _table(self, rows: Iterable[Iterable[sympy.Expr]]) -> tuple[tuple[sympy.Expr, ...], ...]:
        return tuple(map(self._each, rows))
