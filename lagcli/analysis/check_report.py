"""The report of `check`: verdicts, count, joint part, start, warnings; an object with the shape of `check --json`.

And its sentences: cells of the table of constraints, the joint verdict, the count, the start.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from lagcli.errors import diagnostics
from lagcli.model import notebook_html

if TYPE_CHECKING:
    from lagcli.analysis.classification.verdict import Classification, Verdict
    from lagcli.analysis.dof import DofCount
    from lagcli.analysis.redundancy import NullVector
    from lagcli.model.invariant import FirstIntegral
    from lagcli.model.model import Model
    from lagcli.start.consistent_start import Moves
    from lagcli.start.gaps import Side


NOT_UNIQUE = {True: "", False: "not unique", None: "undecided"}
MOST_NAMED = 40  # redundant rows


@dataclasses.dataclass(frozen=True, slots=True)
class ConstraintReport:
    """One row: its verdict, whether it follows from rows before it, and whether its multiplier is uniquely
    determined at generic points of the constraint surface, None where that is undecided.

    side: of a one-sided constraint, where the start lies; its multiplier depends on which others are closed.
    """

    verdict: Verdict
    redundant: bool
    unique: bool | None
    side: Side | None = None

    @property
    def name(self) -> str:
        """The row's name, as in `lambda.NAME`."""
        return self.verdict.row

    def as_json(self) -> dict[str, Any]:
        """An entry of `constraints`."""
        verdict = self.verdict
        found = {
            "name": verdict.row,
            "declared": verdict.declared,
            "verdict": verdict.kind,
            "integral": verdict.integral,
            "integrating_factor": verdict.integrating_factor,
            "redundant": self.redundant,
            "method": verdict.method,
            "unique": self.unique,
        }
        return found if self.side is None else {**found, "state": self.side}


@dataclasses.dataclass(frozen=True, slots=True)
class JointReport:
    """The joint part of the verdict; `derived_flag` is empty and `proof` `none` where it is not decided.

    combinations: first integrals with the rows whose combination each integrates; unsolved: forms of the integrable
    part without a known integral; dimension: of the surface of the holonomic rows in the space of all coordinates, time
    among them where it occurs (counts_time); remarks: where the flag drops, and for which parameters it may be another.
    """

    derived_flag: tuple[int, ...]
    combinations: tuple[FirstIntegral, ...]
    unsolved: tuple[str, ...]
    growth_vector: tuple[int, ...]
    dimension: int
    proof: str
    remarks: tuple[str, ...]
    counts_time: bool = False

    @property
    def integrals(self) -> tuple[str, ...]:
        """The first integrals."""
        return tuple(one.text for one in self.combinations)

    @property
    def is_bracket_generating(self) -> bool:
        """True if brackets of allowed displacements reach every direction of the surface (Chow, Rashevskii)."""
        return bool(self.growth_vector) and self.growth_vector[-1] == self.dimension

    def as_json(self) -> dict[str, Any]:
        """The object `joint`."""
        return {
            "derived_flag": list(self.derived_flag),
            "integrals": list(self.integrals),
            "growth_vector": list(self.growth_vector),
            "proof": self.proof,
        }


def joint(count: DofCount, found: Classification) -> JointReport:
    """The joint part: the flag of all rows, df of the holonomic ones included (their rank stays to the end)."""
    unsolved = tuple(form for group in found.groups for form in group.unsolved)
    # Integrals proved in general, and those that hold for the motions from the start alone
    integrals = tuple(one for group in found.groups for one in (*group.integrals, *group.passing))
    remarks = tuple(dict.fromkeys(remark for group in found.groups for remark in group.remarks))
    dimension, has_time = count.coordinates + found.depends_on_time, found.depends_on_time
    flag, growth, proof = list[int](), list[int](), "none"
    if count.holonomic is not None and found.flag:
        surface = count.holonomic - found.flag[-1]
        flag = [surface + extra for extra in found.flag]
        flag += [flag[-1]] if flag[-1] else []  # the end is 0, or a dimension that is met again
        dimension -= surface
        growth, proof = [dimension - found.flag[0] + more for more in found.growth], count.proof
    return JointReport(tuple(flag), integrals, unsolved, tuple(growth), dimension, proof, remarks, has_time)


@dataclasses.dataclass(frozen=True, slots=True)
class Initial:
    """Largest residuals of the declared start, |f_i| and |B_i v + b_i| of the equations as they are written, -g_j of
    violated one-sided constraints among those of positions.

    assembled: what assembly changes, where that is wanted.
    """

    position_residual: float
    velocity_residual: float
    consistent: bool
    assembled: Moves | None = None

    def as_json(self) -> dict[str, Any]:
        """The object `initial`."""
        found = {
            "position_residual": self.position_residual,
            "velocity_residual": self.velocity_residual,
            "consistent": self.consistent,
        }
        return found if self.assembled is None else {**found, "assembled": self.assembled.as_json()}


@dataclasses.dataclass(frozen=True, slots=True)
class Report:
    """The findings of `check`; `report["dof"]` reads as in JSON."""

    title: str
    path: str
    dof: DofCount
    constraints: tuple[ConstraintReport, ...]
    null_vectors: tuple[NullVector, ...]
    joint: JointReport
    initial: Initial
    warnings: tuple[diagnostics.Diagnostic, ...]

    def __repr__(self) -> str:
        verdicts: dict[str, int] = {}
        for one in self.constraints:
            verdicts[one.verdict.kind] = verdicts.get(one.verdict.kind, 0) + 1
        laws = ", ".join(f"{count} {kind}" for kind, count in verdicts.items()) or "no constraints"
        freedoms = self.dof.configuration_dof
        counted = "undecided" if freedoms is None else str(freedoms)
        return f"<Report on {self.path}: degrees of freedom {counted}; {laws}; {len(self.warnings)} warnings>"

    def _repr_html_(self) -> str:
        rows = [
            (
                one.name,
                one.verdict.declared,
                one.verdict.kind,
                "" if one.verdict.integral is None else f"{one.verdict.integral} = const",
                "redundant" if one.redundant else "",
                one.verdict.method,
            )
            for one in self.constraints
        ]
        low, high = self.dof.bounds
        counted = self.dof.configuration_dof
        sentences = [
            f"degrees of freedom: {counted if counted is not None else f'undecided, {low} to {high}'}",
            "initial values: " + ("consistent" if self.initial.consistent else "inconsistent"),
            *(f"{found.severity}[{found.code}]: {found.message}" for found in self.warnings),
        ]
        headers = ("constraint", "declared", "verdict", "integral", "", "reason")
        return notebook_html.page(
            self.title or self.path, notebook_html.table(headers, rows), notebook_html.sentences(sentences)
        )

    def as_json(self) -> dict[str, Any]:
        """The object of `check --json`."""
        return {
            "dof": self.dof.as_json(),
            "constraints": [constraint.as_json() for constraint in self.constraints],
            "joint": self.joint.as_json(),
            "initial": self.initial.as_json(),
            "warnings": [warning.as_json() for warning in self.warnings],
            "dependences": [vector.as_json() for vector in self.null_vectors],
        }

    def __getitem__(self, key: str) -> Any:
        return self.as_json()[key]


def parts(found: Report) -> list[list[str]]:
    """The lines below the table of constraints: the rows that share forces, the joint verdict where there are
    differential rows, the count."""
    # A count alone has no rows that share forces.
    from lagcli.linear import independent_rows

    shares = independent_rows.shares([vector.rows for vector in found.null_vectors])
    is_differential = any(one.verdict.declared == "differential" for one in found.constraints)
    joint = joint_lines(found.joint) if is_differential else []
    return [[diagnostics.printable(line) for line in shares], joint, count(found.dof)]


def joint_lines(joint: JointReport) -> list[str]:
    """The verdict on all rows together: derived flag, growth vector, integrals."""
    lines = []
    if joint.derived_flag:
        dims = ", ".join(map(str, joint.derived_flag))
        lines.append(f"derived flag of all rows: [{dims}]")
        growth = ", ".join(map(str, joint.growth_vector))
        reach = "" if joint.is_bracket_generating else "not "
        time = " dimensions, time among them" if joint.counts_time else ""
        lines.append(f"growth vector: ({growth}) of {joint.dimension}{time}, {reach}bracket-generating")
    else:
        lines.append("derived flag of all rows: undecided")
    for one in joint.combinations:
        lines.append(f"first integral of {', '.join(one.rows)}: {one.text} = const")
    lines += [f"integrable, without a known integral: {form} = 0" for form in joint.unsolved]
    lines += joint.remarks
    return [diagnostics.printable(line) for line in lines]


def cells(constraint: ConstraintReport) -> dict[str, str]:
    """A row of the table of constraints, by its headers; empty where there is nothing to say."""
    verdict = constraint.verdict
    return {
        "constraint": verdict.row,
        "declared": verdict.declared,
        "verdict": verdict.kind,
        "integral": "" if verdict.integral is None else f"{verdict.integral} = const",
        "factor": "" if verdict.integrating_factor in (None, "1") else str(verdict.integrating_factor),
        "redundant": "yes" if constraint.redundant else "",
        "multiplier": "" if constraint.side else NOT_UNIQUE[constraint.unique],
        "at the start": constraint.side or "",
    }


def count(found: DofCount) -> list[str]:
    """The count, line by line."""
    label = "3N" if found.coordinates == 3 * found.particles else "n"
    lines = [
        f"{_number(found.particles, 'particle')}, {_number(found.coordinates, 'coordinate')}"
        f" ({label} = {found.coordinates})"
    ]
    # A rank proves a count only where rows are independent or follow from one another: all counts are shown.
    if found.rank < found.rows:
        n = found.coordinates
        lines.append(
            f"{label} - rows = {n} - {found.rows} = {n - found.rows} by the number of the rows of f = 0"
        )
        lines.append(f"{label} - rank = {n} - {found.rank} = {n - found.rank} by the rank of their gradients")
    if found.configuration_dof is None:
        low, high = found.bounds
        return [*lines, f"degrees of freedom: undecided, between {low} and {high}: {found.reason}"]
    s, m = found.holonomic or 0, found.nonholonomic or 0
    lines.append(f"s = {_number(s, 'independent holonomic constraint')}")
    if found.redundant:
        names = ", ".join(found.redundant_rows[:MOST_NAMED])
        more = len(found.redundant_rows) - MOST_NAMED
        named = (f": {names}" if names else "") + (f" and {more} more" if more > 0 else "")
        lines.append(f"left out as redundant: {_number(found.redundant, 'row')}{named}")
    lines.append(f"degrees of freedom: {label} - s = {found.coordinates} - {s} = {found.configuration_dof}")
    if m:
        lines.append(f"m = {_number(m, 'independent nonholonomic constraint')}")
        total = f"{found.coordinates} - {s} - {m} = {found.velocity_dof}"
        lines.append(f"velocity degrees of freedom: {label} - s - m = {total}")
    lines += [f"note: {note}" for note in found.notes]
    if found.contacts:
        counted = _number(found.contacts, "one-sided constraint")
        lines.append(f"note: {counted} not counted; `displacements` tells what closed contacts leave free")
    lines.append(f"proof: {found.proof}")
    return [diagnostics.printable(line) for line in lines]


def _number(count: int, thing: str) -> str:
    return f"{count} {thing}" if count == 1 else f"{count} {thing}s"


def start(found: Report) -> str:
    """The sentence about the initial values."""
    initial = found.initial
    if initial.consistent:
        return "initial values: consistent"
    sentence = (
        f"initial values: inconsistent, by {initial.position_residual:.3g} in position and"
        f" {initial.velocity_residual:.3g} in velocity (the largest residuals of the equations as they are written)"
    )
    return sentence if initial.assembled is None else f"{sentence}; `assemble` moves the start"


def of_free_particles(model: Model) -> Report:
    """The report on a model of free particles: there is nothing to be wrong."""
    from lagcli.analysis import dof  # here, as a report that is shown needs none of it
    from lagcli.analysis.classification.verdict import Classification

    counted = dof.of_free_particles(model)
    return Report(
        title=model.title,
        path=model.path,
        dof=counted,
        constraints=(),
        null_vectors=(),
        joint=joint(counted, Classification((), (), False)),
        initial=Initial(0.0, 0.0, True),
        warnings=model.warnings,
    )
