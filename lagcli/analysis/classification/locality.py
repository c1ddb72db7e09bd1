"""The findings of exact algebra in general position, compared with the motions from the start.

What algebra found not to vanish may vanish where the start lies, on its sheet of the holonomic rows and its side of
kinks. Where nothing that it divided by does so its ranks are those there; else algebra says which of these places the
motions from the start keep to, and judges the rows on them. Numbers that follow motions decide nothing of it.
"""

from __future__ import annotations

import dataclasses
import decimal
import functools
import itertools
import sys
from collections.abc import Callable, Sequence
from typing import TypeVar

from lagcli.analysis.classification.exact_start import ExactStart
from lagcli.analysis.classification.verdict import JointVerdict
from lagcli.analysis.numeric_flag import NumericFlag
from lagcli.model.invariant import FirstIntegral
from lagcli.pfaffian import function_field, joint, special_points, translate
from lagcli.pfaffian.exact import enclosure, time_limit
from lagcli.pfaffian.forms import form, notation
from lagcli.pfaffian.forms.form import PfaffianBlock
from lagcli.pfaffian.forms.notation import TIME
from lagcli.pfaffian.joint import RowVerdicts
from lagcli.pfaffian.special_points import Expression
from lagcli.start import precise_rows

# Operations for the equations of a set and for the integrals on it.
BUDGET = 60_000
# No answer of algebra about a place.
OPEN: tuple[type[Exception], ...] = (function_field.NotDecidedError, *time_limit.NO_ANSWER)
Answer = TypeVar("Answer")
Equations = tuple[Expression, ...]


def agree(flagged: joint.Flagged, numbers: NumericFlag) -> bool:
    """True if the flag along the motions from the start is that of general position."""
    found, extra = flagged.flag, numbers.extra
    if len(extra) > 1 and extra[-1] == extra[-2]:
        extra = extra[:-1]
    return numbers.is_certain and (extra, numbers.inside) == (found.dims, found.inside)


@dataclasses.dataclass(frozen=True)
class Settled:
    """Where motions from the start stay: equations, none of which it may take, and the flag of exact algebra there.

    beyond: how many of the equations are independent; vanishing: the rows that are zero there; is_sided: the flag is
    that of the start's side of kinks. Where rows on the place demand g dt = 0 the flag has no more than that.
    """

    equations: Equations
    flagged: joint.Flagged
    beyond: int
    vanishing: frozenset[str]
    is_sided: bool

    @property
    def rank(self) -> int:
        """The rank of all rows there, with the holonomic ones of the group."""
        return _surface_rank(self.flagged) + self.flagged.flag.dims[0]


class Locality:
    """What motions from the start of a group of rows keep to; `deadline`: of `progress.after`."""

    def __init__(self, start: ExactStart, translation: translate.Translation, deadline: float) -> None:
        self.start, self._translation, self._deadline = start, translation, deadline

    def demanded(self, block: PfaffianBlock, flagged: joint.Flagged) -> joint.Flagged | None:
        """The flag whose conditions motions from the start meet: that of general position, or on a place that they
        keep to; None where that is open."""
        if self._is_demanded(block, flagged):
            return flagged
        own = self._own_factors(flagged.flag.divisors)
        whole = flagged.block.with_values(self._translation.values)
        # The rank is lower at the start, where the conditions hold: a place is only kept by rows that count there.
        kept = self._kept(whole, (), own, None) if own and not self._on_side(block).has_kinks else None
        there = self._flagged(block, kept) if kept else None
        if there is None or not there.flag.contradiction or self._own_factors(there.flag.divisors) != []:
            return None
        return there

    def _is_demanded(self, block: PfaffianBlock, flagged: joint.Flagged) -> bool:
        """True if motions from the start meet the conditions of a flag: rows demand the same ones where something that
        algebra divided by vanishes, or it is these that vanish there."""
        conditions = [one.factors for one in flagged.flag.conditions]
        demanded = [special_points.own_factor(factors, self.start.point) for factors in conditions]
        places: dict[frozenset[Expression], joint.Flagged] = {frozenset(): flagged}
        ahead: list[tuple[Expression, ...]] = [()]
        for place in ahead:  # it grows: on a place algebra may divide by more
            found = places.get(frozenset(place)) or self._flagged(block, place)
            own = None if found is None else self._own_factors(found.flag.divisors)
            if found is None or own is None or len(place) > len(block.variables):
                return False
            if [one.factors for one in found.flag.conditions] != conditions:
                return False
            places[frozenset(place)] = found
            # One of the factors or more of them, in all ways.
            more = [
                tuple(special_points.distinct(place, some))
                for k in range(1, len(own) + 1)
                for some in itertools.combinations(own, k)
            ]
            ahead += [
                there
                for there in more
                if frozenset(there) not in places and special_points.distinct(there, demanded) != list(there)
            ]
        return True

    def settled(self, block: PfaffianBlock, flagged: joint.Flagged) -> Settled | None:
        """Where motions from the start stay, of what algebra divided by, and the flag there; None where it is open."""
        own = self._own_factors(flagged.flag.divisors)
        is_sided = any(map(form.has_kinks, own or ()))
        if own:
            block = self._on_side(block)
            if block.has_kinks or self.start.point.digits is None:
                return None  # the start lies on a kink, or its digits are not known
        if is_sided:
            there = self._flagged(block, ())
            if there is None or there.flag.contradiction:
                return None
            flagged, own = there, self._own_factors(there.flag.divisors)
        whole = self._on_side(flagged.block.with_values(self._translation.values))
        equations: Equations = ()
        found = flagged
        for _ in range(3):
            rank = _surface_rank(found) + found.flag.dims[0] - len(flagged.values)
            kept = None if own is None else self._kept(whole, equations, own, rank)
            if kept is None:
                return None
            if not kept:
                break
            equations = kept
            there = self._flagged(block, equations)
            if there is None:
                return None
            found, own = there, self._own_factors(there.flag.divisors)
            if found.flag.contradiction:
                return Settled(equations, found, 0, frozenset(), is_sided) if own == [] else None
        else:
            return None
        if not equations and not is_sided:
            return Settled((), found, 0, frozenset(), False)
        plain = block.with_values(self._translation.values)
        vanishing = self._asked(lambda: special_points.vanishing(plain, equations))
        if vanishing is None:
            return None
        return Settled(equations, found, _surface_rank(found) - _surface_rank(flagged), vanishing, is_sided)

    def _kept(
        self, block: PfaffianBlock, equations: Equations, own: Sequence[Expression], rank: int | None
    ) -> Equations | None:
        """The equations with those of one more place that motions from the start keep to, if they keep to any of some
        (the factors of what vanishes there); None where that is open."""
        is_open = False
        for e in own:
            if e.free_symbols <= {TIME}:
                continue  # time goes on
            place = (*equations, e)
            search = functools.partial(special_points.kept, block, place, rank, self.is_at_start)
            kept = self._asked(functools.partial(search, self._deadline))
            if kept:
                return kept
            is_open |= kept is None
        return None if is_open else ()

    def following(self, block: PfaffianBlock, settled: Settled) -> frozenset[str] | None:
        """The differential rows that follow from rows before them, by their values at the start in fifty digits; None
        where these have another rank than the rows have on the motions from it."""
        gradients = [[form.partial(f, x) for x in block.variables] for f in block.surface]
        rows = [[form.plain(a) for a in row] for row in (*gradients, *block.rows)]
        with decimal.localcontext(
            prec=precise_rows.PARAMETERS.digits, Emin=decimal.MIN_EMIN, Emax=decimal.MAX_EMAX
        ):
            try:
                values = [[self.start.decimal(a) for a in row] for row in rows]
            except enclosure.NoValueError:
                return None
            found = precise_rows.following(values)
        if len(rows) - len(found) != settled.rank:
            return None
        s = len(block.surface)
        return frozenset(block.names[i - s] for i in found if i >= s)

    def open_reason(self, flagged: joint.Flagged) -> str:
        """Why a flag is not decided where it is open whether motions from the start stay."""
        own = self._own_factors(flagged.flag.divisors)
        where = f"keep to {notation.written(own[0])} = 0, where" if own else "stay where"
        return f"it was not found whether motions from the start {where} the derived flag is different"

    def _on_side(self, block: PfaffianBlock) -> PfaffianBlock:
        """The block as it is on the start's side of its kinks."""
        here = self.start.point
        return dataclasses.replace(
            block,
            rows=tuple(tuple(special_points.on_side(form.plain(a), here) for a in row) for row in block.rows),
            surface=tuple(special_points.on_side(form.plain(f), here) for f in block.surface),
        )

    def on_place(
        self, block: PfaffianBlock, settled: Settled, integrals: Sequence[FirstIntegral], single: RowVerdicts
    ) -> JointVerdict:
        """The verdict where motions from the start stay; integrals: of rows that are integrable alone. The
        differentials of its equations lie in the system, and count in each part of it."""
        flag = settled.flagged.flag
        names = block.names
        inside = frozenset(name for name, is_inside in zip(names, flag.inside, strict=True) if is_inside)
        together = JointVerdict(
            names,
            tuple(k + settled.beyond for k in flag.dims),
            flag.growth,
            inside,
            tuple(one for one in integrals if inside.issuperset(one.rows)),
            (),
            "symbolic" if flag.is_exact else "numeric",
        )
        of_rows = [
            None if name in settled.vanishing else one for name, one in zip(names, single, strict=True)
        ]
        solved = None
        if flag.dims[-1]:
            solved = self._asked(lambda: joint.solution(settled.flagged, of_rows, self._deadline))
        passing = () if solved is None else solved.integrals
        return self.with_passing(together, block, settled.equations, passing, settled.vanishing)

    def with_passing(
        self,
        together: JointVerdict,
        block: PfaffianBlock,
        where: Sequence[Expression],
        passing: Sequence[joint.JointIntegral],
        vanishing: frozenset[str],
    ) -> JointVerdict:
        """A verdict with the place that motions from the start keep to, integrals on it and rows that vanish there."""
        lasting = tuple(one for one in together.integrals if vanishing.isdisjoint(one.rows))
        known = {one.text for one in lasting}
        values = self._translation.values
        written = [translate.first_integral(one.phi, one.rows, values) for one in passing]
        note = "verdicts and count hold for the motions from the start"
        names = special_points.sentences(block, where, self.start.point)
        if names:
            note += f", which keep to {', '.join(names[:3])}"
        return dataclasses.replace(
            together,
            integrals=lasting,
            passing=tuple(one for one in written if one.text not in known),
            notes=(f"{note}; on another sheet, set or side of a kink they are different", *together.notes),
            vanishing=together.vanishing | vanishing,
        )

    def _own_factors(self, divisors: Sequence[Expression | None]) -> list[Expression] | None:
        """The factors of divisors that vanish at the start; None where they are not known. Of a product that vanishes
        there another factor may be small wherever motions come to."""
        vanishing = [e for e in divisors if e is None or self.is_at_start(e)]
        if not vanishing:
            return []

        def work() -> list[Expression]:
            return special_points.distinct(special_points.of(vanishing, [self.start.point]))

        own = self._asked(work)
        return None if None in vanishing else own or None

    def is_at_start(self, expression: Expression) -> bool:
        """True if an expression is zero at the start to all digits, or has no value there."""
        return special_points.vanishes(expression, [self.start.point])

    def lost(self, block: PfaffianBlock) -> frozenset[str]:
        """The rows that vanish at the start, to all digits; not by the time alone, which all motions leave."""
        found = vanishing_rows(block, [self.start.point])
        return frozenset(
            name
            for name, row in zip(block.names, block.rows, strict=True)
            if name in found and any(a.free_symbols & set(block.variables) - {TIME} for a in row)
        )

    def of_motions(
        self, together: JointVerdict, block: PfaffianBlock, numbers: NumericFlag, single: RowVerdicts
    ) -> JointVerdict:
        """The verdict of numbers that are certain on rows whose flag algebra did not find: of the motions from the
        start alone, with what need not hold elsewhere told as such."""
        points = [self.start.point, *map(self.start.reached, numbers.states[1:])]
        sheets: list[Expression] = []
        if numbers.on_piece or numbers.extra[-1]:
            # The factors that vanish along the motions, of holonomic rows that have others.
            found = self._asked(lambda: special_points.sheets(block, points))
            sheets = special_points.distinct(found or ())
        vanishing = vanishing_rows(block, points)
        if numbers.on_piece or sheets:
            # Numbers that took values for zero prove nothing against exact algebra on a row alone.
            alone = any(
                name in together.inside and one is not None and one.kind == "nonholonomic"
                for name, one in zip(together.rows, single, strict=True)
            )
            is_rounded = numbers.digits > sys.float_info.dig + 1 or len(single) == 1
            if together.inside and numbers.error > enclosure.CANCELLED and alone and is_rounded:
                reason = (
                    f"numbers took values of up to {numbers.error:.0e} of their terms for zero, and exact algebra did"
                    " not find the derived flag"
                )
                return JointVerdict(block.names, reason=reason)
            return self.with_passing(together, block, sheets, (), vanishing)
        if len(points) == 1:
            return together  # the start alone may be special
        # Rows that vanish on all motions have no integrals.
        lasting = tuple(one for one in together.integrals if vanishing.isdisjoint(one.rows))
        return dataclasses.replace(together, integrals=lasting, vanishing=together.vanishing | vanishing)

    def _asked(self, work: Callable[[], Answer]) -> Answer | None:
        """The answer of algebra within the budget, None where there is none."""
        try:
            return time_limit.run(self._deadline, work, BUDGET)
        except OPEN:
            return None

    def _flagged(self, block: PfaffianBlock, equations: Sequence[Expression]) -> joint.Flagged | None:
        """The flag of the block with some more equations, where algebra finds it."""
        plain = block.with_values(self._translation.values)
        surface = (*plain.surface, *(e.xreplace(self._translation.values) for e in equations))
        there = dataclasses.replace(plain, surface=surface)
        return self._asked(lambda: joint.flagged(there, TIME, {}, self._deadline))


def _surface_rank(found: joint.Flagged) -> int:
    """The rank of the holonomic rows, and of the equations of a place, where a flag was found."""
    return len(found.values) + found.flag.holonomic_rank


def vanishing_rows(block: PfaffianBlock, points: Sequence[special_points.SpecialPoint]) -> frozenset[str]:
    """The rows that vanish at all points."""
    return frozenset(
        name
        for name, row in zip(block.names, block.rows, strict=True)
        if all(special_points.is_nothing(form.plain(a), points) for a in row if a != 0)
    )
