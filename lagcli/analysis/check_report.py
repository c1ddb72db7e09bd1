"""The report of `check`: verdicts, count, joint part, start, warnings; an object with the shape of `check --json`."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from lagcli.errors import diagnostics
from lagcli.model import notebook_html

if TYPE_CHECKING:
    from lagcli.analysis.classification.verdict import Classification, Verdict
    from lagcli.analysis.dof import DofCount
    from lagcli.analysis.uniqueness import NullVector
    from lagcli.model.invariant import FirstIntegral
    from lagcli.start.assembly_moves import Moves
    from lagcli.start.gaps import Side


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
    part without a known integral; dimension: of the surface of the holonomic rows in the space of all coordinates,
    time among them where it occurs (counts_time); remarks: where the flag drops, and for which parameters it may be
    another.
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
    dimension = count.coordinates + found.depends_on_time
    if count.holonomic is None or not found.flag:
        return JointReport(
            (), found.everything, unsolved, (), dimension, "none", found.remarks, found.depends_on_time
        )
    surface = count.holonomic - found.flag[-1]
    dims = [surface + extra for extra in found.flag]
    # The end is 0, or a dimension that is met again.
    flag = tuple(dims if dims[-1] == 0 else [*dims, dims[-1]])
    dimension -= surface
    growth = tuple(dimension - found.flag[0] + more for more in found.growth)
    return JointReport(
        flag, found.everything, unsolved, growth, dimension, count.proof, found.remarks, found.depends_on_time
    )


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
