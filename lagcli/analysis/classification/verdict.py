"""The findings of the classification: of every row, of every group of rows, and of all of them; and the verdicts that
need no search, of rows declared as holonomic and of one-sided ones."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Literal

from lagcli.frozen import frozen_value
from lagcli.model import model as nouns
from lagcli.model.invariant import FirstIntegral

if TYPE_CHECKING:
    from lagcli.start.initial import State

Declared = Literal["holonomic", "differential", "inequality"]
Kind = Literal[
    "holonomic", "exact", "integrable", "jointly-integrable", "nonholonomic", "undecided", "inequality"
]
Proof = Literal["symbolic", "numeric", "none"]


@frozen_value
class Verdict:
    """The proved facts of one row. `integral` and `integrating_factor` are texts in the model's notation."""

    row: str
    declared: Declared
    kind: Kind
    method: str
    proof: Proof
    integral: str | None = None
    integrating_factor: str | None = None


@frozen_value
class Condition:
    """A hidden holonomic condition g = 0 that rows demand by g dt = 0; `text` is g in the model's notation."""

    text: str
    rows: tuple[str, ...]


class HiddenConditionsError(Exception):
    """Rows demand conditions that are not among those of the system: it is to be classified with them."""

    def __init__(self, conditions: tuple[Condition, ...]) -> None:
        super().__init__(", ".join(f"{one.text} = 0" for one in conditions))
        self.conditions = conditions


@frozen_value
class JointVerdict:
    """The derived flag of coupled differential rows, beyond the df of the holonomic rows they meet.

    flag: dim I, I', I'', ..., to the one that stays; empty where it is not decided, and then `reason` says why. growth:
    by how much D, D + [D, D], ... exceed D = ker I. inside: the rows that lie in the integrable part I^(oo). integrals:
    functions whose differentials span it as far as they were found; `unsolved`: those of its forms that have none.
    remarks: where the flag drops and for which parameters; notes: what of that concerns this very start and these
    parameters. vanishing: rows that vanish identically where the holonomic rows hold. holonomic_rank: that of the
    holonomic rows they meet, where it is proved exactly. passing: integrals that hold on the set alone that the motions
    from the start keep to. may_demand: the flag is not decided, and the rows demand holonomic conditions that are not
    known, or may do so. lost: rows that vanish at the start, to all digits, and not everywhere. following: where exact
    algebra and digits tell another rank of the rows than doubles, those that follow from rows before them.
    """

    rows: tuple[str, ...]
    flag: tuple[int, ...] = ()
    growth: tuple[int, ...] = ()
    inside: frozenset[str] = frozenset()
    integrals: tuple[FirstIntegral, ...] = ()
    unsolved: tuple[str, ...] = ()
    proof: Proof = "none"
    reason: str = ""
    remarks: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    vanishing: frozenset[str] = frozenset()
    holonomic_rank: int = 0
    passing: tuple[FirstIntegral, ...] = ()
    may_demand: bool = False
    lost: frozenset[str] = frozenset()
    following: frozenset[str] | None = None

    @property
    def is_decided(self) -> bool:
        """True if the flag is known."""
        return bool(self.flag)


@frozen_value
class Classification:
    """Verdicts of the differential rows in their order, and of the groups they fall into."""

    verdicts: tuple[Verdict, ...]
    groups: tuple[JointVerdict, ...]
    depends_on_time: bool

    @property
    def undecided(self) -> tuple[JointVerdict, ...]:
        """The groups whose flag is not known."""
        return tuple(group for group in self.groups if not group.is_decided)

    @property
    def flag(self) -> tuple[int, ...]:
        """The flags of the groups added up, its end not repeated; empty where one is not known."""
        return _summed([group.flag for group in self.groups]) if not self.undecided else ()

    @property
    def growth(self) -> tuple[int, ...]:
        """The growths of the groups added up; empty where one is not known."""
        return _summed([group.growth for group in self.groups]) if not self.undecided else ()

    def doubted(self, rows: frozenset[str], reason: str) -> Classification:
        """The classification with the groups of some rows undecided: all that was found of them together is open."""
        doubted = [group for group in self.groups if not rows.isdisjoint(group.rows)]
        groups = tuple(
            JointVerdict(one.rows, integrals=one.integrals, reason=reason) if one in doubted else one
            for one in self.groups
        )
        open_rows = {name for group in doubted for name in group.rows}
        method = f"Whether it is integrable together with the rows it meets is open: {reason}."
        verdicts = tuple(
            dataclasses.replace(one, kind="undecided", integral=None, method=method, proof="none")
            if one.row in open_rows and one.kind not in ("exact", "integrable")
            else one
            for one in self.verdicts
        )
        return Classification(verdicts, groups, self.depends_on_time)


def _summed(sequences: list[tuple[int, ...]]) -> tuple[int, ...]:
    """The sums of sequences that stay at their last value."""
    length = max((len(s) for s in sequences), default=1)
    sums = [sum(s[min(k, len(s) - 1)] for s in sequences) for k in range(length)]
    while len(sums) > 1 and sums[-1] == sums[-2]:
        sums.pop()
    return tuple(sums)


def of_holonomic(model: nouns.Model, row_names: tuple[str, ...]) -> tuple[Verdict, ...]:
    """Verdicts of the rows declared as holonomic, `row_names` being those of the system."""
    texts = {row for law in model.holonomic for row in law.rows}
    bodies = {body.name for body in model.rigid}
    verdicts = []
    for row in row_names:
        if row in texts:
            method = "declared in positions"
        elif row.rpartition(".")[0] in bodies:
            method = f"row of the rigid body `{row.rpartition('.')[0]}`"
        else:
            continue
        verdicts.append(Verdict(row, "holonomic", "holonomic", method, "symbolic"))
    return tuple(verdicts)


def of_one_sided(model: nouns.Model) -> tuple[Verdict, ...]:
    """Verdicts of the one-sided constraints, in their order."""
    method = "declared as one-sided: not counted in s"
    return tuple(Verdict(row, "inequality", "inequality", method, "symbolic") for row in model.contact_names)


@frozen_value
class Orbit:
    """Rows by their numbers, and states to which motions from the start come, as far as these rows see them."""

    rows: tuple[int, ...]
    states: tuple[State, ...]


@frozen_value
class KnownIntegrals:
    """First integrals of the differential rows, notes on those that are not known, the hidden conditions, and where
    motions from the start were followed."""

    integrals: tuple[FirstIntegral, ...] = ()
    notes: tuple[str, ...] = ()
    conditions: tuple[Condition, ...] = ()
    orbits: tuple[Orbit, ...] = ()
