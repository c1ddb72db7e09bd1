"""Coupled rows -> their verdicts, alone and together, written in the notation of the model.

Exact algebra decides where it can. Where it cannot, the flag is taken from numbers on the surface.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import math
from collections.abc import Iterable

from lagcli.analysis.classification import locality
from lagcli.analysis.classification.case import Case, CoupledGroup
from lagcli.analysis.classification.exact_start import ExactStart
from lagcli.analysis.classification.verdict import (
    Condition,
    HiddenConditionsError,
    JointVerdict,
    Kind,
    Proof,
    Verdict,
)
from lagcli.analysis.numeric_flag import NumericFlag
from lagcli.linear import rank
from lagcli.model.invariant import FirstIntegral
from lagcli.pfaffian import frobenius, function_field, joint, special_points, translate
from lagcli.pfaffian.exact import time_limit, zero_test
from lagcli.pfaffian.forms import notation
from lagcli.pfaffian.forms.form import Form, PfaffianBlock
from lagcli.pfaffian.joint import RowVerdicts
from lagcli.start import initial, projection

Names = tuple[str, ...]
# Operations for the exact flag of a group before numbers are asked, and after they have shown that it does not vanish.
PROMPT, PATIENT = 25_000, 80_000
EXCEPTIONAL = (
    "the verdict is that for these values of the parameters: for nearly all others it would be another"
)


class Classifier:
    """Judges the groups of one model, each kind of them once."""

    def __init__(self, case: Case, deadline: float) -> None:
        self._case, self._deadline = case, deadline
        self._translation = translate.Translation(case.system.model)
        self._forms = self._translation.forms()
        self._alike = joint.Memo()

    def judge(self, group: CoupledGroup) -> tuple[tuple[Verdict, ...], JointVerdict]:
        """The verdicts of the rows of a group, and their joint one."""
        names, declared = self._names(group.differential), self._block(group)
        if declared is not None:
            start = ExactStart(self._case, group, declared, self._translation)
            self._locality = locality.Locality(start, self._translation, self._deadline)
        block, flagged = self._flagged(group, declared, PROMPT)
        settled = self._settled(group, block, flagged)
        numbers = None if settled is not None else self._case.flag(group, self._deadline)
        single = [self._alone(name) for name in names]
        solved: tuple[FirstIntegral, ...] = ()
        if numbers is not None and block is not None and flagged is None:
            # All integrals of rows whose flag is known by numbers, or none where not all are found
            wanted = numbers.extra[-1] if numbers.is_certain else 0
            with contextlib.suppress(*time_limit.NO_ANSWER):
                if wanted:
                    solved = self._written(
                        joint.without_flag(block, wanted, single, self._deadline).integrals
                    )
            solved = solved if len(solved) == wanted else ()
            if not numbers.is_certain or len(solved) < wanted:
                block, flagged = self._flagged(group, block, PATIENT)
                settled = self._settled(group, block, flagged)
        if block is not None and settled is not None:
            if not settled.equations and not settled.is_sided:  # general position
                together = self._exact(block, settled.flagged, single)
            else:
                alone = self._integrals_alone(block.names, single)
                together = self._locality.on_place(block, settled, alone, single)
            rows = projection.rows(self._case.numeric, self._case.begin).take(list(group.rows))
            if rank.estimate(rows).value != settled.rank:  # doubles tell another one
                following = self._locality.following(block, settled)
                together = dataclasses.replace(together, following=following)
        else:
            assert numbers is not None
            if block is None or not numbers.is_certain:
                together = self._numeric(names, numbers, single, solved)
            elif flagged is None:
                together = self._numeric(names, numbers, single, solved)
                together = self._locality.of_motions(together, block, numbers, single)
            elif locality.agree(flagged, numbers):
                together = self._exact(block, flagged, single)
            else:
                together = JointVerdict(names, reason=self._locality.open_reason(flagged))
        if block is not declared:
            together = dataclasses.replace(together, notes=(EXCEPTIONAL, *together.notes))
        if declared is not None:
            lost = self._locality.lost(declared) - together.vanishing
            together = dataclasses.replace(together, lost=lost) if lost else together
        return tuple(_verdict(name, one, together) for name, one in zip(names, single, strict=True)), together

    def _settled(
        self, group: CoupledGroup, block: PfaffianBlock | None, flagged: joint.Flagged | None
    ) -> locality.Settled | None:
        """Where motions from the start stay. Raises as `_flagged` does, of a place that they keep to."""
        found = None if block is None or flagged is None else self._locality.settled(block, flagged)
        if found is not None and found.flagged.flag.contradiction:
            self._demand(group, found.flagged)
        return found

    def _alone(self, name: str) -> frobenius.FormVerdict | None:
        """The verdict of a row by itself, for the values of the parameters; None where it is too large."""
        form = self._forms[name]
        if isinstance(form, notation.TooLarge):
            return None
        found, values = self._alike.classify(form, self._deadline), self._translation.values
        is_special = any(self._translation.vanishes(e) for e in found.exceptional)
        if not is_special and found.witness is not None and found.witness.free_symbols & values.keys():
            # The witness that no integrating factor exists may be nothing for these values.
            is_zero = zero_test.is_zero(found.witness.xreplace(values), self._deadline)
            is_special = is_zero.truth is not False
        if not is_special and found.integral is not None:
            # A root of a parameter that is negative is none.
            below = {p.base for p in translate.roots(found.integral)}
            constant = (e for e in below if e.free_symbols and e.free_symbols <= values.keys())
            is_special = any(not e.xreplace(values).evalf() >= 0 for e in constant)
        return self._alike.classify(form.with_values(values), self._deadline) if is_special else found

    def _names(self, rows: Iterable[int]) -> Names:
        return tuple(self._case.system.rows.rows[i].name for i in rows)

    def _block(self, group: CoupledGroup) -> PfaffianBlock | None:
        """The group in symbols; None where a row is too large for exact algebra, rows are many, or one has no text."""
        if len(group.holonomic) > 40:
            return None
        names, holonomic = self._names(group.differential), self._names(group.holonomic)
        surface = self._translation.surface(frozenset(holonomic)) if holonomic else {}
        forms = [self._forms[name] for name in names]
        holonomic_rank = [surface.get(name) for name in holonomic]
        if any(part is None or isinstance(part, notation.TooLarge) for part in (*forms, *holonomic_rank)):
            return None
        known = [form for form in forms if isinstance(form, Form)]
        return self._translation.block(known, holonomic_rank)

    def _flagged(
        self, group: CoupledGroup, block: PfaffianBlock | None, budget: int
    ) -> tuple[PfaffianBlock | None, joint.Flagged | None]:
        """The flag of exact algebra, None where the budget of operations is too little for it. Where the parameters
        have values for which the flag may be another than in general, the block is given back with these values put in.
        Raises `diagnostics.ModelError` where a combination of rows says dt = 0, and `HiddenConditionsError` where one
        says g dt = 0."""
        if block is None:
            return None, None
        values = {p: self._translation.values[p] for p in block.parameters}

        def work() -> joint.Flagged:
            search = functools.partial(joint.flagged, block, notation.TIME, values, self._deadline)
            return self._alike.of_block(block, search, "flag")

        try:
            found = time_limit.run(self._deadline, work, budget)
        except function_field.ExceptionalError:
            return self._flagged(group, block.with_values(self._translation.values), budget)
        except (function_field.NotDecidedError, time_limit.TimeUpError):
            return block, None
        if found.flag.contradiction:
            may_hold = all(one.factors for one in found.flag.conditions)
            demanded = self._locality.demanded(block, found) if may_hold else found
            if demanded is None:
                return block, None
            self._demand(group, demanded)
        return block, found

    def _demand(self, group: CoupledGroup, found: joint.Flagged) -> None:
        """Raise what rows demand of which a combination is g dt: that g = 0, or the impossible."""
        numbers = group.differential
        if not all(one.factors for one in found.flag.conditions):
            raise initial.contradiction(self._case.system, [numbers[i] for i in found.flag.contradiction])
        raise HiddenConditionsError(
            tuple(
                Condition(
                    notation.written(special_points.own_factor(one.factors, self._locality.start.point)),
                    self._names(numbers[i] for i in one.rows),
                )
                for one in found.flag.conditions
            )
        )

    def _exact(self, block: PfaffianBlock, flagged: joint.Flagged, single: RowVerdicts) -> JointVerdict:
        """The joint verdict of exact algebra."""
        found, names = flagged.flag, block.names
        integrals: tuple[FirstIntegral, ...] = ()
        unsolved: tuple[str, ...] = ()
        if found.dims[-1]:
            search = functools.partial(joint.solution, flagged, single, self._deadline)
            solved = self._alike.of_block(block, search, "solution")
            integrals = self._written(solved.integrals)
            unsolved = tuple(notation.written(form) for form in solved.unsolved)
        at_start = {notation.written(e): self._locality.is_at_start(e) for e in found.special}
        special = {text: at for text, at in at_start.items() if len(text) <= 60}  # longer ones tell nothing
        remarks = [f"special where {text} = 0: there the derived flag is different" for text in special]
        if found.exceptional:
            values = " or ".join(f"{notation.written(e)} = 0" for e in found.exceptional)
            remarks.append(f"shown for parameters in general; with {values} it may be another")
        notes = [
            f"the start is a special configuration: {text} = 0 there; the rows lead away from it, and the count is that"
            " of the motions from it"
            for text, at in special.items()
            if at
        ]
        notes += [
            f"the start lies beside {notation.written(e)} = 0 and not on it: it is judged as it is written, to 40"
            " digits; on it the derived flag is different"
            for e in found.special
            if notation.written(e) in special and special_points.beside(e, self._locality.start.point)
        ]
        return JointVerdict(
            names,
            found.dims,
            found.growth,
            _picked(names, found.inside),
            integrals,
            unsolved,
            "symbolic" if found.is_exact else "numeric",
            remarks=tuple(remarks),
            notes=tuple(notes),
            vanishing=frozenset(names[i] for i in found.vanishing),
            holonomic_rank=len(flagged.values) + found.holonomic_rank,
        )

    def _written(self, integrals: Iterable[joint.JointIntegral]) -> tuple[FirstIntegral, ...]:
        values = self._translation.values
        return tuple(translate.first_integral(one.phi, one.rows, values) for one in integrals)

    def _numeric(
        self, names: Names, numbers: NumericFlag, single: RowVerdicts, solved: tuple[FirstIntegral, ...]
    ) -> JointVerdict:
        """The joint verdict of numbers, with the integrals `solved`, or else those of rows alone."""
        if not numbers.is_certain:
            may_demand = numbers.has_time and (numbers.dimension is None or numbers.contradiction)
            return JointVerdict(names, reason=numbers.reason, may_demand=may_demand)
        inside = _picked(names, numbers.inside)
        integrals = solved or tuple(
            one for one in self._integrals_alone(names, single) if inside.issuperset(one.rows)
        )
        remark = (
            f"proved by numbers of {numbers.digits} digits on the surface: what counts as zero is below"
            f" {max(numbers.error, 1e-300):.0e} of its size"
        )
        if numbers.least < math.inf:
            remark += f", all else above {numbers.least:.0e}"
        return JointVerdict(
            names, numbers.extra, numbers.growth, inside, integrals, (), "numeric", remarks=(remark,)
        )

    def _integrals_alone(self, names: Names, single: RowVerdicts) -> tuple[FirstIntegral, ...]:
        """The integrals of rows that are integrable alone."""
        return tuple(
            translate.first_integral(one.integral, (name,), self._translation.values)
            for name, one in zip(names, single, strict=True)
            if one is not None and one.integral is not None
        )


def _picked(names: Names, flags: tuple[bool, ...]) -> frozenset[str]:
    return frozenset(name for name, flag in zip(names, flags, strict=True) if flag)


def _verdict(name: str, one: frobenius.FormVerdict | None, together: JointVerdict) -> Verdict:
    """The verdict of a row from what it is alone and what all are together."""
    kind: Kind = "undecided" if one is None else one.kind
    method = "the form is too large for exact algebra" if one is None else one.method
    proof: Proof = "none" if one is None else one.proof
    integral: str | None = None
    factor: str | None = None
    if name in together.vanishing:
        kind, proof = "exact", together.proof
        method = "The form vanishes identically where the holonomic constraints hold: it says nothing."
        if together.passing or name not in together.inside:
            method = "The form vanishes along the motions from the start: it says nothing."
    elif kind in ("exact", "integrable"):
        assert one is not None
        integral = None if one.integral is None else notation.written(one.integral)
        factor = None if one.integrating_factor is None else notation.written(one.integrating_factor)
    elif not together.is_decided:
        if (kind == "nonholonomic" and len(together.rows) > 1) or together.reason:
            method = f"{method} Whether it is integrable together with the rows it meets is open: {together.reason}."
            kind, proof = "undecided", "none"
    elif name in together.inside:
        # An integral in which the row takes part, one of as few rows as there are.
        own = [each for each in (*together.integrals, *together.passing) if name in each.rows]
        integral = min(own, key=lambda each: len(each.rows)).text if own else None
        alone = f" Alone it does not: {method[0].lower()}{method[1:]}" if kind == "nonholonomic" else ""
        method = f"It lies in the integrable part of all rows together (derived flag).{alone}"
        kind, proof = "jointly-integrable", together.proof
    elif kind == "undecided":
        method = (
            "It does not lie in the integrable part of all rows together, so that alone it is not integrable."
        )
        kind, proof = "nonholonomic", together.proof
    return Verdict(name, "differential", kind, method, proof, integral, factor)
