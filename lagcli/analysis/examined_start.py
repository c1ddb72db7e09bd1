"""The start of a run, with all that is known there before its first step, as one frozen object."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lagcli.analysis.classification.verdict import KnownIntegrals
from lagcli.compiled import NumericSystem
from lagcli.equations import system as mechanics
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.frozen import frozen

if TYPE_CHECKING:
    from lagcli.compiled.selection import Selection
    from lagcli.start.assembly import Assembly
    from lagcli.start.initial import State


@frozen
class ExaminedStart:
    """A state where a run can begin, how it was moved there, if it was, the independent rows, whether they are
    dependent there and not nearby, and the first integrals and hidden conditions of its rows."""

    state: State
    assembly: Assembly | None
    selection: Selection
    is_singular: bool
    known: KnownIntegrals


def first_integrals(system: System, numeric: NumericSystem, limit: float) -> KnownIntegrals:
    """The first integrals of the differential rows as far as they are found in `limit` seconds."""
    if not system.model.differential:
        return KnownIntegrals()
    from lagcli.analysis.classification import classify

    return classify.search(system, numeric, limit)


def examine(
    system: System, numeric: NumericSystem, given: KnownIntegrals | None, limit: float
) -> ExaminedStart:
    """The start of a model, on hidden conditions too.

    given: the first integrals of its rows, if they are known; else they are searched for `limit` seconds.
    Raises `diagnostics.ModelError` where no run can begin.
    """
    from lagcli.analysis import redundancy
    from lagcli.start import consistent_start

    def integrals() -> KnownIntegrals:
        return first_integrals(system, numeric, limit) if given is None else given

    try:
        begin = consistent_start.known(system, numeric)
        known = integrals()
    except diagnostics.ModelError as error:
        from lagcli.analysis.classification import classify

        # Off a hidden condition no velocity satisfies the rows.
        known = integrals() if classify.is_conflict(error) else KnownIntegrals()
        if not known.conditions:
            raise
    whole = None
    if known.conditions:
        from lagcli.analysis.classification import classify

        extended = classify.extended(system, known.conditions)
        whole = extended, NumericSystem(extended)
        # The conditions may have angles of their own, whose cuts the whole system counts among its values.
        begin = consistent_start.find(*whole).with_numbers(mechanics.values(system))
    selection, is_singular = redundancy.begin(system, numeric, begin.state, whole, known.orbits)
    return ExaminedStart(begin.state, begin.assembly, selection, is_singular, known)
