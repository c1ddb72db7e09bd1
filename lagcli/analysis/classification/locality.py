"""The findings of exact algebra in general position, compared with the motions from the start.

Algebra judges all sheets of the holonomic rows, all sides of kinks and all points at once; what it found not to
vanish may vanish where the start lies. Where nothing that it divided by vanishes at the start its ranks are those
there. Else numbers decide, along the motions from the start; where they differ, the equations of the set that these
keep to are sought, and the integrals on it.
"""

from __future__ import annotations

import dataclasses
import itertools
import sys
from collections.abc import Sequence

from lagcli.analysis.classification import exact_start
from lagcli.analysis.classification.case import Case, CoupledGroup
from lagcli.analysis.classification.verdict import JointVerdict
from lagcli.analysis.numeric_flag import NumericFlag
from lagcli.pfaffian import joint, special_points, translate
from lagcli.pfaffian.exact import time_limit
from lagcli.pfaffian.flag import function_field
from lagcli.pfaffian.forms import form, notation
from lagcli.pfaffian.forms.form import PfaffianBlock
from lagcli.pfaffian.forms.notation import TIME
from lagcli.pfaffian.single_form import frobenius
from lagcli.pfaffian.special_points import Expression

# Operations for the equations of a set and for the integrals on it.
BUDGET = 60_000
MOST_LISTED = 3  # equations that are named


def agree(flagged: joint.Flagged, numbers: NumericFlag) -> bool:
    """True if the flag along the motions from the start is that of general position."""
    found, extra = flagged.flag, numbers.extra
    if len(extra) > 1 and extra[-1] == extra[-2]:
        extra = extra[:-1]
    return numbers.is_certain and (extra, numbers.inside) == (found.dims, found.inside)


class Locality:
    """The start of a group of rows in the symbols of a translation; `deadline`: of `progress.after`.

    block: the group as it is declared.
    """

    def __init__(
        self,
        case: Case,
        group: CoupledGroup,
        block: PfaffianBlock,
        translation: translate.Translation,
        deadline: float,
    ) -> None:
        self._case, self._translation, self._deadline = case, translation, deadline
        self._start = exact_start.ExactStart(case, group, block, translation)

    def is_regular(self, flagged: joint.Flagged) -> bool:
        """True if the ranks of exact algebra are those at the start: nothing that it divided by vanishes there."""
        return not any(e is None or self.is_at_start(e) for e in flagged.flag.divisors)

    def is_demanded(self, block: PfaffianBlock, flagged: joint.Flagged) -> bool:
        """True if motions from the start meet the conditions of a flag: rows demand the same ones of those that stay
        where something that algebra divided by vanishes, and of those that do not, or it is these that vanish there."""
        own = self._own_factors(flagged.flag.divisors)
        if own is None:
            return False
        demanded = [self.own_factor(one.factors) for one in flagged.flag.conditions]
        for some in itertools.chain.from_iterable(
            itertools.combinations(own, k) for k in range(1, len(own) + 1)
        ):
            if special_points.distinct(some, demanded) == list(some):
                continue
            there = self._flagged(block, some)
            if there is None or there.flag.conditions != flagged.flag.conditions:
                return False
            others = self._own_factors(there.flag.divisors)
            if others is None or not set(own).issuperset(others):
                return False
        return True

    def is_left(self, flagged: joint.Flagged, numbers: NumericFlag) -> bool:
        """True if motions from the start come to where nothing that algebra divided by vanishes, or numbers were
        carried there (`is_carried_off`).

        What vanishes at the start and not at another of their points does so at few of them: rows are analytic.
        """
        own = self._own_factors(flagged.flag.divisors)
        return own is not None and not any(self._vanishes_on(e, self._points(numbers)[1:]) for e in own)

    def is_carried_off(self, block: PfaffianBlock, flagged: joint.Flagged, numbers: NumericFlag) -> bool:
        """True if numbers left a set that motions from the start keep to by exact algebra: steep rows amplify rounding.

        The set is smooth at the start, the start is on it to all digits, and its differential lies in the system.
        """
        points = self._points(numbers)
        return any(
            not self._vanishes_on(e, points)
            and not all(self.is_at_start(e.diff(x)) for x in e.free_symbols)
            and self._on(block, [e], numbers, is_proved=True) is not None
            for e in self._own_factors(flagged.flag.divisors) or ()
        )

    def _vanishes_on(self, expression: Expression, points: Sequence[special_points.SpecialPoint]) -> bool:
        """True if an expression, as it is on the start's side of its kinks, is zero on all points."""
        return special_points.vanishes(special_points.on_side(expression, self._start.point), points)

    def _own_factors(self, divisors: Sequence[Expression | None]) -> list[Expression] | None:
        """The factors of divisors that vanish at the start; None where they are not known.

        Of a product that vanishes there another factor may be small wherever motions come to.
        """
        vanishing = [e for e in divisors if e is None or self.is_at_start(e)]

        def work() -> list[Expression]:
            return special_points.distinct(special_points.of(vanishing, [self._start.point]))

        try:
            own = time_limit.run(self._deadline, work, BUDGET) if vanishing else []
        except time_limit.NO_ANSWER:
            return None
        return None if None in vanishing or (vanishing and not own) else own

    def is_at_start(self, expression: Expression) -> bool:
        """True if an expression is zero at the start to all digits, or has no value there."""
        return special_points.vanishes(expression, [self._start.point])

    def lost(self, block: PfaffianBlock) -> frozenset[str]:
        """The rows that vanish at the start, to all digits; not by the time alone, which all motions leave."""
        found = _vanishing(block, [self._start.point])
        return frozenset(
            name
            for name, row in zip(block.names, block.rows, strict=True)
            if name in found and any(a.free_symbols & set(block.variables) - {TIME} for a in row)
        )

    def is_beside(self, expression: Expression) -> bool:
        """True if an expression that is not zero at the start is so near to zero that doubles cannot tell."""
        return special_points.beside(expression, self._start.point)

    def has_sheets(self, block: PfaffianBlock, numbers: NumericFlag) -> bool:
        """True if a holonomic row has other factors than those that vanish along the motions from the start."""
        points = self._points(numbers)
        try:
            return bool(time_limit.run(self._deadline, lambda: special_points.sheets(block, points), BUDGET))
        except time_limit.NO_ANSWER:
            return False

    def own_factor(self, factors: Sequence[Expression]) -> Expression:
        """The factor that vanishes at the start, if one alone does, or is all but zero there; else the product."""
        here = self._start.point
        own = [e for e in factors if special_points.vanishes(e, [here])]
        own = own or [e for e in factors if special_points.beside(e, here)]
        return own[0] if len(own) == 1 else special_points.product(factors)

    def without_vanishing(
        self, together: JointVerdict, block: PfaffianBlock, numbers: NumericFlag
    ) -> JointVerdict:
        """The verdict of numbers, in which rows that vanish along the motions from the start have no integrals."""
        points = self._points(numbers)
        vanishing = (
            _vanishing(block, points) if len(points) > 1 else frozenset()
        )  # the start alone may be special
        lasting = tuple(one for one in together.integrals if vanishing.isdisjoint(one.rows))
        return dataclasses.replace(together, integrals=lasting, vanishing=together.vanishing | vanishing)

    def with_passing(
        self,
        together: JointVerdict,
        block: PfaffianBlock,
        flagged: joint.Flagged | None,
        numbers: NumericFlag,
        single: Sequence[frobenius.FormVerdict | None],
    ) -> JointVerdict:
        """The verdict of numbers with the set that motions from the start keep to, and integrals on it."""
        points = self._points(numbers)
        vanishing = _vanishing(block, points)
        of_rows = [None if name in vanishing else one for name, one in zip(block.names, single, strict=True)]
        candidates = self._candidates(block, flagged, points)
        where, passing = self._set(block, candidates, numbers, of_rows)
        doubt = "" if where else self._doubt(block, flagged, numbers, together, single)
        if doubt:
            kept = None if flagged is None else self._kept(block, flagged, numbers)
            if kept is None:
                return JointVerdict(block.names, (), (), frozenset(), (), (), "none", reason=doubt)
            where, passing = kept[0], self._integrals(kept[1], of_rows)
            together = _exact(together, kept[1], numbers)
        lasting = tuple(one for one in together.integrals if vanishing.isdisjoint(one.rows))
        known = {one.text for one in lasting}
        written_integrals = [
            translate.first_integral(one.phi, one.rows, self._translation.values) for one in passing
        ]
        note = "verdicts and count hold for the motions from the start"
        names = special_points.sentences(block, where or candidates[0], points[0])
        if names:
            note += f", which keep to {', '.join(names[:MOST_LISTED])}"
        return dataclasses.replace(
            together,
            integrals=lasting,
            passing=tuple(one for one in written_integrals if one.text not in known),
            notes=(f"{note}; on another sheet, set or side of a kink they are different", *together.notes),
            vanishing=together.vanishing | vanishing,
        )

    def _doubt(
        self,
        block: PfaffianBlock,
        flagged: joint.Flagged | None,
        numbers: NumericFlag,
        together: JointVerdict,
        single: Sequence[frobenius.FormVerdict | None],
    ) -> str:
        """Say why numbers that took values for zero prove nothing, where no set was found that motions keep to."""
        divisors = () if flagged is None else flagged.flag.divisors
        near = [e for e in divisors if e is not None and self.is_beside(e)]
        if near:
            return (
                f"the start lies so near {notation.written(near[0])} = 0, and not on it, that numbers cannot tell what"
                " the rows say there"
            )
        if flagged is not None and self.is_carried_off(block, flagged, numbers):
            return "numbers left a set that the motions from the start keep to: the rows amplify rounding"
        alone = any(
            name in together.inside and one is not None and one.kind == "nonholonomic"
            for name, one in zip(block.names, single, strict=True)
        )
        is_rounded = numbers.digits > sys.float_info.dig + 1 or len(single) == 1
        if (
            together.inside
            and numbers.error > special_points.PARAMETERS.zero
            and (flagged is not None or (alone and is_rounded))
        ):
            return (
                f"numbers took values of up to {numbers.error:.0e} of their terms for zero, and no set was found that"
                " the motions from the start keep to"
            )
        return ""

    def _set(
        self,
        block: PfaffianBlock,
        candidates: Sequence[Sequence[Expression]],
        numbers: NumericFlag,
        single: Sequence[frobenius.FormVerdict | None],
    ) -> tuple[Sequence[Expression], Sequence[joint.JointIntegral]]:
        """Equations of the set on which the flag is that of numbers, as few as there are, and the integrals there."""
        for equations in candidates:
            found = self._fewest(block, equations, numbers)
            if found is None:
                continue
            # Where several equations are needed one coordinate that stands still may say it.
            plain = (
                self._fewest(block, candidates[-1][len(candidates[0]) :], numbers)
                if len(found[0]) > 1
                else None
            )
            if plain is not None and len(plain[0]) < len(found[0]):
                found = plain
            return found[0], self._integrals(found[1], single)
        return (), ()

    def _fewest(
        self, block: PfaffianBlock, equations: Sequence[Expression], numbers: NumericFlag
    ) -> tuple[Sequence[Expression], joint.Flagged] | None:
        """The equations without those that the flag does not need, and it; None where it is another than of numbers."""
        found = self._on(block, equations, numbers)
        if found is None:
            return None
        for e in sorted(equations, key=lambda e: (-e.count_ops(), str(e))):
            fewer = [other for other in equations if other is not e]
            there = self._on(block, fewer, numbers)
            if there is not None:
                equations, found = fewer, there
        return equations, found

    def _kept(
        self, block: PfaffianBlock, flagged: joint.Flagged, numbers: NumericFlag
    ) -> tuple[Sequence[Expression], joint.Flagged] | None:
        """Equations that hold at the start to all digits and that motions keep to, and the flag of exact algebra there,
        which is that of the motions; None where it may be another. Nothing is taken from values of numbers, but ranks.
        """
        equations: list[Expression] = []
        found = flagged
        for _ in range(MOST_LISTED):
            if self.is_left(found, numbers) and not self.is_carried_off(block, found, numbers):
                return equations, found
            own = self._own_factors(found.flag.divisors) or []
            new = [e for e in own if self._on(block, [*equations, e], numbers, is_proved=True) is not None]
            there = self._on(block, [*equations, *new], numbers, is_proved=True) if new else None
            if there is None:
                return None
            equations, found = [*equations, *new], there
        return None

    def _points(self, numbers: NumericFlag) -> list[special_points.SpecialPoint]:
        """The start, and the other points of its motions that numbers have met."""
        return [self._start.point, *map(self._start.reached, numbers.states[1:])]

    def _candidates(
        self,
        block: PfaffianBlock,
        flagged: joint.Flagged | None,
        points: Sequence[special_points.SpecialPoint],
    ) -> list[list[Expression]]:
        """Equations that hold on all points: those of sheets and special points, and with those of what stands
        still."""

        def work() -> list[Expression]:
            divisors = flagged.flag.divisors if flagged is not None else ()
            return special_points.distinct(
                special_points.sheets(block, points), special_points.of(divisors, points)
            )

        try:
            own = time_limit.run(self._deadline, work, BUDGET)
        except time_limit.NO_ANSWER:
            own = []
        return [own, [*own, *special_points.still(block, points, self._start.written(block.variables))]]

    def _on(
        self,
        block: PfaffianBlock,
        equations: Sequence[Expression],
        numbers: NumericFlag,
        is_proved: bool = False,
    ) -> joint.Flagged | None:
        """The block with some more equations that motions keep to, if its flag is that of numbers or `is_proved`."""
        found = self._flagged(block, equations)
        if found is None:
            return None
        holonomic_rank = len(found.values) + found.flag.holonomic_rank
        dims, extra = found.flag.dims, numbers.extra
        # The same rank with the equations and without: their differentials lie in the system, and motions keep to them.
        is_kept = dims and holonomic_rank + dims[0] == numbers.surface + extra[0]
        is_same = is_proved or holonomic_rank + dims[-1] == numbers.surface + extra[-1]
        return found if is_kept and is_same else None

    def _flagged(self, block: PfaffianBlock, equations: Sequence[Expression]) -> joint.Flagged | None:
        """The flag of the block with some more equations, where algebra finds it."""
        if not equations:
            return None
        plain = block.with_values(self._translation.values)
        surface = (*plain.surface, *(e.xreplace(self._translation.values) for e in equations))
        there = dataclasses.replace(plain, surface=surface)
        try:
            return time_limit.run(
                self._deadline, lambda: joint.flagged(there, TIME, {}, self._deadline), BUDGET
            )
        except function_field.NotDecidedError:
            return None
        except time_limit.NO_ANSWER:
            return None

    def _integrals(
        self, found: joint.Flagged, single: Sequence[frobenius.FormVerdict | None]
    ) -> Sequence[joint.JointIntegral]:
        if not found.flag.dims[-1]:
            return ()
        try:
            return time_limit.run(
                self._deadline, lambda: joint.solution(found, single, self._deadline).integrals, BUDGET
            )
        except time_limit.NO_ANSWER:
            return ()


def _exact(together: JointVerdict, found: joint.Flagged, numbers: NumericFlag) -> JointVerdict:
    """The verdict with the flag of exact algebra on a set that motions keep to: the differentials of its equations lie
    in the system, and count in each part of it."""
    flag = found.flag
    equations = len(found.values) + flag.holonomic_rank - numbers.surface
    inside = frozenset(name for name, is_inside in zip(together.rows, flag.inside, strict=True) if is_inside)
    return dataclasses.replace(
        together,
        flag=tuple(k + equations for k in flag.dims),
        growth=flag.growth,
        inside=inside,
        integrals=tuple(one for one in together.integrals if inside.issuperset(one.rows)),
        proof="symbolic" if flag.is_exact else "numeric",
        remarks=(),
    )


def _vanishing(block: PfaffianBlock, points: Sequence[special_points.SpecialPoint]) -> frozenset[str]:
    """The rows that vanish at all points."""
    return frozenset(
        name
        for name, row in zip(block.names, block.rows, strict=True)
        if all(special_points.is_nothing(form.plain(a), points) for a in row if a != 0)
    )
