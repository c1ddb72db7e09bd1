"""The search for first integrals of one system: strategies propose, and what they propose is verified."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import sympy

from lagcli.pfaffian import combinations, elimination, potential, tidy_integral
from lagcli.pfaffian import kernel_frame as frames
from lagcli.pfaffian.exact import guarded, normal_form, time_limit, zero_test
from lagcli.pfaffian.exact.guarded import NoAnswerError
from lagcli.pfaffian.forms import form as forms

# Each |u| doubles the cases that are proved.
MAX_KINKS = 3


@dataclass(frozen=True, slots=True)
class SearchResult:
    """A verified first integral; `how` completes the sentence "found ..."."""

    integral: sympy.Expr
    how: str


Proposals = Iterator[SearchResult]
Strategy = Callable[["IntegralSearch"], Proposals]
Ways = Sequence[tuple[Strategy, int]]
"""Strategies, cheap ones first, and the operations that each may take."""


def found_by(
    block: forms.PfaffianBlock,
    ways: Ways,
    deadline: float,
    wanted: int | None = None,
    budget: int | None = None,
) -> list[SearchResult]:
    """The verified and independent integrals found in the time; wanted: how many there are, one for each row else;
    budget: of operations."""
    search = IntegralSearch(block, ways, deadline, wanted)
    with contextlib.suppress(*time_limit.NO_ANSWER):
        time_limit.run(deadline, search.run, budget)
    return search.found


class IntegralSearch:
    """The search for the integrals of one system: its frame, and what was found so far, all of it verified; `factors`:
    invariant surfaces found on the way; `used`: how many integrals were used to eliminate coordinates."""

    def __init__(
        self, block: forms.PfaffianBlock, ways: Ways, deadline: float, wanted: int | None = None
    ) -> None:
        self.block, self._ways, self.deadline, self._wanted = block, ways, deadline, wanted
        self.found: list[SearchResult] = []
        self._holonomic: list[sympy.Expr] = []
        self.factors: list[sympy.Expr] = []
        self.used = 0

    def run(self) -> None:
        """Search until all integrals are found or nothing is left to try. Raises `TimeUpError` and `NoAnswerError`."""
        block = self.block
        time = [x for x in block.variables if x.name == elimination.TIME]
        gradients = [tuple(forms.partial(f, x) for x in block.variables) for f in block.surface]
        rows = [*gradients, *block.rows]
        self.frame = frames.of(rows, block.variables, block.parameters, time)
        self.entries = [e for row in self.frame.solved for e in row]
        if not frames.belongs(self.frame, rows, self.deadline, block.surface):
            raise normal_form.NoNormalFormError("the kernel of the rows is not known")
        for f in block.surface:
            if self._is_new(f):
                self._holonomic.append(f)
        for strategy, budget in self._ways:
            if self.is_complete:
                return
            time_limit.check(self.deadline)
            with contextlib.suppress(*time_limit.NO_ANSWER):
                time_limit.run(self.deadline, partial(self._take, strategy), budget)

    @property
    def is_complete(self) -> bool:
        """True if no more integrals exist."""
        return len(self.integrals) >= len(self.frame.pivots) or len(self.found) == self._wanted

    @property
    def integrals(self) -> list[sympy.Expr]:
        """The known constants of motion: the surface and what was found."""
        return [*self._holonomic, *(f.integral for f in self.found)]

    def alphabet(self, *more: sympy.Expr) -> combinations.Alphabet:
        """The letters of the frame. On a surface those of the constants too: its points have various of them."""
        constants = sorted(combinations.constants_of(self.frame), key=str) if self.block.surface else []
        return combinations.alphabet(self.entries, self.frame.variables, [*more, *constants])

    def _take(self, strategy: Strategy) -> None:
        """Keep each proposal, or its tidy form, that is proved to be an integral that is new."""
        for proposal in strategy(self):
            ways = [proposal.integral]
            with contextlib.suppress(NoAnswerError):
                ways.insert(0, time_limit.run(self.deadline, partial(neat, proposal.integral, self.frame)))
            for way in dict.fromkeys(ways):
                if not potential.writable(way):
                    continue
                rates = zero_test.vanish(self.frame.rates(way), self.deadline, self.block.surface)
                if rates.truth is zero_test.Truth.YES and self._is_new(way):
                    # What comes after the budget is not found, at whatever moment it is ended.
                    time_limit.check(self.deadline)
                    self.found.append(SearchResult(way, proposal.how))
                    break
            if self.is_complete:
                return

    def _is_new(self, phi: sympy.Expr) -> bool:
        """True if its differential is proved independent of those known, on every side of all kinks."""
        pivots = [self.frame.variables[p] for p in self.frame.pivots]
        matrix = [[forms.partial(f, x) for x in pivots] for f in (*self.integrals, phi)]
        if len(matrix) > len(pivots):
            return False
        sides = forms.kink_sides(matrix, forms.moduli(matrix)[:MAX_KINKS])
        return all(frames.has_rank(side, len(matrix), self.deadline, self.block.surface) for side in sides)


def neat(phi: sympy.Expr, frame: frames.KernelFrame) -> sympy.Expr:
    """The integral as a person would write it; every function of it is one as well."""
    if not phi.has(sympy.log):
        above, below = sympy.fraction(guarded.together(phi))
        if below.free_symbols and not below.free_symbols & set(frame.variables):
            phi = guarded.expand(above)
    if phi.is_Add and not phi.has(sympy.log, sympy.atan):
        rest = phi.primitive()[1]
        rest = -rest if rest.could_extract_minus_sign() else rest
        return min((rest, guarded.factor(rest)), key=lambda way: (way.count_ops(), len(str(way))))
    return tidy_integral.integral(phi, frame.variables)
