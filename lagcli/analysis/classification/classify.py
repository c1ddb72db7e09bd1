"""A model -> the classification of its differential rows: alone (D.3), and together with all rows they meet.

A combination of rows that says g(q, t) dt = 0 demands the hidden condition g = 0: a system is classified again with the
conditions that its rows demand, until nothing new comes. Only a g that vanishes nowhere, or only at single times, is a
contradiction.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from lagcli import compiled, progress
from lagcli.analysis.classification.case import Case
from lagcli.analysis.classification.verdict import (
    Classification,
    Condition,
    HiddenConditionsError,
    JointVerdict,
    KnownIntegrals,
    Orbit,
)
from lagcli.compiled import NumericSystem, row_block
from lagcli.equations import row_parameters
from lagcli.equations import system as mechanics
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.expression import parser
from lagcli.frozen import frozen_value
from lagcli.model import family, settings
from lagcli.model import model as nouns
from lagcli.start import assembly, initial

QUICK = progress.Counted(1.0)  # seconds for numbers to show that nothing is integrable
AGAIN = "the hidden conditions of the rows have no end that algebra sees"


@frozen_value
class Classified:
    """A case with all conditions that its rows demand among its holonomic rows, and its classification."""

    case: Case
    found: Classification
    conditions: tuple[Condition, ...]

    @property
    def notes(self) -> tuple[str, ...]:
        """The sentences about the conditions."""
        return tuple(
            f"hidden condition {equation(one)}: {quoted(one.rows)} {'demands' if len(one.rows) == 1 else 'demand'} it,"
            " for a combination of these rows is a multiple of dt; it counts as a holonomic constraint"
            for one in self.conditions
        )


def equation(condition: Condition) -> str:
    """The condition as an equation, which is also the name of its row."""
    return f"{condition.text} = 0"


def classified(system: System, numeric: NumericSystem, limit: float = settings.LIMIT) -> Classified:
    """The classification of a system at the consistent state nearest to its start. `limit`: seconds. Raises
    `diagnostics.ModelError` where there is no such state and where rows contradict each other."""
    start, model = initial.declared(system), system.model
    values = tuple(part.tobytes() for part in (start.q, start.v, start.p))
    settled = row_parameters.formulas(model), model.simulation.duration, limit
    question = ("classification", start.t, *values, *settled)
    return numeric.memory.answer(
        question, lambda: _classified(system, numeric, limit), (diagnostics.ModelError,)
    )


def _classified(system: System, numeric: NumericSystem, limit: float) -> Classified:
    conditions: tuple[Condition, ...] = ()
    deadline = progress.after(limit)
    for _ in range(30):  # rounds of conditions that demand others
        conflict = None
        with progress.phase("looking for a consistent start"):
            try:
                begin = assembly.begin(system, numeric)
            except diagnostics.ModelError as error:
                if not system.model.differential or not is_conflict(error):
                    raise
                # Off a hidden condition no velocity satisfies the rows.
                begin, conflict = assembly.configuration(system, numeric, initial.declared(system)), error
        case = Case(system, numeric, begin)
        try:
            with progress.phase("classifying the constraints"):
                judged = []
                if case.groups:  # SymPy costs half a second that holonomic models need not spend
                    from lagcli.analysis.classification import classifier

                    until = progress.after(progress.left(deadline) if conditions else limit)
                    judging = classifier.Classifier(case, until)
                    judged = [judging.judge(group) for group in case.groups]
        except HiddenConditionsError as hidden:
            known = {one.text for one in conditions}
            new = tuple({one.text: one for one in hidden.conditions if one.text not in known}.values())
            if not new:
                break
            conditions += new
            system = extended(system, new)
            numeric = compiled.NumericSystem(system)
            continue
        if conflict is not None:
            raise conflict
        verdicts = {v.row: v for rows, _ in judged for v in rows}
        in_order = tuple(verdicts[row.name] for row in system.rows.rows[system.holonomic_count :])
        groups = tuple(one for _, one in judged)
        depends_on_time = row_block.depends_on_time(system)  # as a coordinate of the forms
        return Classified(case, Classification(in_order, groups, depends_on_time), conditions)
    names = tuple(row.name for row in system.rows.rows[system.holonomic_count :])
    nothing = JointVerdict(names, reason=AGAIN, may_demand=True)
    return Classified(case, Classification((), (nothing,), True), conditions)


def certainly_nonholonomic(case: Case) -> bool:
    """True if numbers alone show that no combination of differential rows is integrable, which takes no SymPy."""
    flags = (case.flag(group, progress.after(QUICK)) for group in case.groups)
    return all(found.is_certain and not found.extra[-1] for found in flags)


def extended(system: System, conditions: Sequence[Condition]) -> System:
    """The system with conditions as further holonomic rows, which stand last among the declared ones."""
    model, rows_by_name = system.model, {row.name: row for row in system.rows.rows}
    laws = {law_row: law for law in model.differential for law_row in law.rows}
    more = []
    for one in conditions:
        origin = laws[rows_by_name[one.rows[-1]].name].equation.origin
        text = dataclasses.replace(origin, value=equation(one))
        expression = nouns.Expression(parser.parse_equation(text.value), text)
        more.append(nouns.Holonomic(family.one(equation(one)), expression, False))
    fingerprint = "; ".join([model.fingerprint, *map(equation, conditions)])
    return mechanics.build(
        dataclasses.replace(model, holonomic=(*model.holonomic, *more), fingerprint=fingerprint)
    )


def is_conflict(error: diagnostics.ModelError) -> bool:
    """True if rows were found to contradict each other."""
    return any(one.code == "contradictory-constraints" for one in error.diagnostics)


def quoted(names: Sequence[str]) -> str:
    """Names of rows in a sentence."""
    return ", ".join(f"`{name}`" for name in names)


def search(built: System, numeric: NumericSystem, limit: float) -> KnownIntegrals:
    """The first integrals of the differential rows as far as they are found in `limit` seconds. Where numbers show that
    there are none, no algebra is asked; other masses and forces that rows do not hold ask for no other search.
    """
    try:
        with progress.phase("looking for a consistent start"):
            case = Case(built, numeric, assembly.begin(built, numeric))
    except diagnostics.ModelError as error:
        if not is_conflict(error):
            raise
        return _by_algebra(built, numeric, limit)
    begin, model = case.begin, built.model
    held = numeric.memory.answer("parameters of rows", lambda: row_parameters.of_rows(built))
    parts = begin.q.tobytes(), begin.v.tobytes(), begin.p[held].tobytes()
    question = ("search", begin.t, *parts, row_parameters.formulas(model), model.simulation.duration, limit)
    found = numeric.memory.known(question)
    if not isinstance(found, KnownIntegrals):
        found = _searched(case, built, numeric, limit)
        if not found.conditions:  # those are looked for at other states too
            numeric.memory.keep(question, found)
    # The orbits with the numbers of this model: those of them that the rows hold are the same.
    orbits = (
        Orbit(one.rows, tuple(dataclasses.replace(state, p=begin.p) for state in one.states))
        for one in found.orbits
    )
    return dataclasses.replace(found, orbits=tuple(orbits))


def _searched(case: Case, built: System, numeric: NumericSystem, limit: float) -> KnownIntegrals:
    try:
        if certainly_nonholonomic(case):
            return KnownIntegrals(orbits=case.orbits(progress.after(limit)))
    except diagnostics.ModelError as error:
        if not is_conflict(error):
            raise
    return _by_algebra(built, numeric, limit)


def _by_algebra(built: System, numeric: NumericSystem, limit: float) -> KnownIntegrals:
    whole = classified(built, numeric, limit)
    orbits = whole.case.orbits(progress.after(limit)) if not whole.conditions else ()
    # A note on all rows with integrals that were not found, and one on those of which nothing was decided.
    unknown: list[str] = []
    undecided: list[str] = []
    for group in whole.found.groups:
        if not group.is_decided:
            undecided += group.rows
        elif len(group.integrals) + len(group.passing) < group.flag[-1]:
            # Where no row alone lies in the integrable part a combination of them does.
            unknown += [row for row in group.rows if row in group.inside] or group.rows
    unknown_parts = []
    if unknown:
        unknown_parts.append(f"not all integrals of {initial.quoted(unknown, 4)} were found")
    if undecided:
        unknown_parts.append(f"it is undecided whether {initial.quoted(undecided, 4)} can be integrated")
    return KnownIntegrals(
        tuple(one for group in whole.found.groups for one in group.integrals),
        tuple(
            f"{what}: integrals that are not known are enforced at velocity level only, to the integration tolerance"
            for what in unknown_parts
        ),
        whole.conditions,
        orbits,
    )
