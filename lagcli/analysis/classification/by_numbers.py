"""The verdict of numbers on coupled rows whose flag exact algebra did not find: of the motions from the start alone."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Sequence

from lagcli.analysis.classification import locality
from lagcli.analysis.classification.locality import Locality
from lagcli.analysis.classification.verdict import JointVerdict
from lagcli.analysis.numeric_flag import NumericFlag
from lagcli.pfaffian import frobenius, special_points
from lagcli.pfaffian.exact import time_limit
from lagcli.pfaffian.forms.form import PfaffianBlock
from lagcli.pfaffian.special_points import Expression


def of_motions(
    together: JointVerdict,
    block: PfaffianBlock,
    numbers: NumericFlag,
    single: Sequence[frobenius.FormVerdict | None],
    where: Locality,
    deadline: float,
) -> JointVerdict:
    """The verdict of numbers that are certain, with what need not hold elsewhere told as such."""
    points = where.points(numbers)
    sheets = _sheets(block, points, deadline) if numbers.on_piece or numbers.extra[-1] else []
    if numbers.on_piece or sheets:
        doubt = _doubt(numbers, together, single)
        if doubt:
            return JointVerdict(block.names, (), (), frozenset(), (), (), "none", reason=doubt)
        return where.with_passing(together, block, sheets, (), locality.vanishing_rows(block, points))
    if len(points) == 1:
        return together  # the start alone may be special
    # Rows that vanish on all motions have no integrals.
    vanishing = locality.vanishing_rows(block, points)
    lasting = tuple(one for one in together.integrals if vanishing.isdisjoint(one.rows))
    return dataclasses.replace(together, integrals=lasting, vanishing=together.vanishing | vanishing)


def _sheets(
    block: PfaffianBlock, points: Sequence[special_points.SpecialPoint], deadline: float
) -> list[Expression]:
    """The factors that vanish along the motions from the start, of holonomic rows that have others."""
    try:
        return special_points.distinct(
            time_limit.run(deadline, lambda: special_points.sheets(block, points), locality.BUDGET)
        )
    except time_limit.NO_ANSWER:
        return []


def _doubt(
    numbers: NumericFlag, together: JointVerdict, single: Sequence[frobenius.FormVerdict | None]
) -> str:
    """Say why numbers that took values for zero prove nothing against exact algebra on a row alone, or nothing."""
    alone = any(
        name in together.inside and one is not None and one.kind == "nonholonomic"
        for name, one in zip(together.rows, single, strict=True)
    )
    is_rounded = numbers.digits > sys.float_info.dig + 1 or len(single) == 1
    if together.inside and numbers.error > special_points.PARAMETERS.zero and alone and is_rounded:
        return (
            f"numbers took values of up to {numbers.error:.0e} of their terms for zero, and exact algebra did not find"
            " the derived flag"
        )
    return ""
