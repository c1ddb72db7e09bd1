"""The report of `check`: verdicts, count, joint part, start, warnings; an object with the shape of `check --json`."""

from __future__ import annotations

import dataclasses
from typing import Any

from lagcli import diagnostics
from lagcli.classification import Verdict
from lagcli.degrees_of_freedom import DofCount


@dataclasses.dataclass(frozen=True, slots=True)
class ConstraintReport:
    """One row: its verdict and whether it follows from rows before it."""

    verdict: Verdict
    redundant: bool

    @property
    def name(self) -> str:
        """The row's name, as in `lambda.NAME`."""
        return self.verdict.row

    def as_json(self) -> dict[str, Any]:
        """An entry of `constraints`."""
        verdict = self.verdict
        return {
            "name": verdict.row,
            "declared": verdict.declared,
            "verdict": verdict.kind,
            "integral": verdict.integral,
            "integrating_factor": verdict.integrating_factor,
            "redundant": self.redundant,
            "method": verdict.method,
        }


@dataclasses.dataclass(frozen=True, slots=True)
class Joint:
    """The joint part of the verdict; `derived_flag` is empty and `proof` `none` where it is not decided."""

    derived_flag: tuple[int, ...]
    integrals: tuple[str, ...]
    growth_vector: tuple[int, ...]
    proof: str

    def as_json(self) -> dict[str, Any]:
        """The object `joint`."""
        return {
            "derived_flag": list(self.derived_flag),
            "integrals": list(self.integrals),
            "growth_vector": list(self.growth_vector),
            "proof": self.proof,
        }


def joint(count: DofCount, differential: tuple[Verdict, ...], holonomic_rows: int) -> Joint:
    """The joint part as far as verdicts alone decide it.

    All rows integrable: the flag of their independent combinations stays. One row that is not, and nothing
    else: it drops to zero. Otherwise the joint question is open.
    """
    kinds = [verdict.kind for verdict in differential]
    integrals = tuple(verdict.integral for verdict in differential if verdict.integral is not None)
    if count.configuration_dof is None or count.holonomic is None:
        return Joint((), integrals, (), "none")
    if all(kind in ("exact", "integrable") for kind in kinds):
        proof = "symbolic" if kinds and not holonomic_rows else "numeric"
        return Joint((count.holonomic,) * 2 if count.holonomic else (0,), integrals, (), proof)
    return Joint((count.holonomic + 1, count.holonomic, *((count.holonomic,) if count.holonomic else ())),
                 integrals, (), "numeric" if holonomic_rows else "symbolic")  # fmt: skip


@dataclasses.dataclass(frozen=True, slots=True)
class Initial:
    """Largest residuals of the declared start, |f_i| / |B_i| and |B_i v + b_i| / |B_i|."""

    position_residual: float
    velocity_residual: float
    consistent: bool


@dataclasses.dataclass(frozen=True, slots=True)
class Report:
    """What `check` finds; `report["dof"]` reads as in JSON."""

    title: str
    path: str
    dof: DofCount
    constraints: tuple[ConstraintReport, ...]
    joint: Joint
    initial: Initial
    warnings: tuple[diagnostics.Diagnostic, ...]

    def as_json(self) -> dict[str, Any]:
        """The object of `check --json`."""
        return {
            "dof": self.dof.as_json(),
            "constraints": [constraint.as_json() for constraint in self.constraints],
            "joint": self.joint.as_json(),
            "initial": dataclasses.asdict(self.initial),
            "warnings": [warning.as_json() for warning in self.warnings],
        }

    def __getitem__(self, key: str) -> Any:
        return self.as_json()[key]
