"""The words of an axis: what a column is, by its name and what is known of its table, and its unit."""

from __future__ import annotations

import re
from collections.abc import Sequence

from lagcli.model import dimension_facts
from lagcli.output.figures import labels, panels
from lagcli.output.tables.provenance import TableFacts

# Kinds in which what is 1e-12 of the largest column is rounding: they have one unit and come from the same sums.
COMPARABLE = ("position", "velocity", "multiplier", "constraint force")
PLURALS = {
    "time": "t",
    "position": "positions",
    "velocity": "velocities",
    "coordinate": "coordinates",
    "rate": "rates",
    "multiplier": "multipliers λ",
    "constraint force": "constraint forces R",
    "constraint force of a coordinate": "constraint forces R of coordinates",
    "generalized force": "generalized forces Q",
    "energy": "energy",
    "error": "errors",
    "other": "",
}
# Units of these are not the same for all columns of the kind.
OPEN = ("coordinate", "rate", "other", "constraint force of a coordinate", "generalized force", "error")


class ColumnWords:
    """The words for the columns of one table."""

    def __init__(self, columns: Sequence[str], facts: TableFacts) -> None:
        self._columns, self._facts = frozenset(columns), facts
        units = facts.units
        short = (
            [labels.shortened(u, labels.UNIT) for u in (units.length, units.mass, units.time)]
            if units
            else []
        )
        self._units = labels.ShortUnits(*short) if short else None

    def kind(self, column: str) -> str:
        """The kind of a column, a key of PLURALS."""
        for pattern, kind in _PREFIXES:
            if pattern.fullmatch(column):
                return kind
        stem, _, member = column.rpartition(".")
        if stem and member in ("x", "y", "z") and self._is_particle(stem):
            return "position"
        if stem and member in ("vx", "vy", "vz") and self._is_particle(stem):
            return "velocity"
        return "coordinate" if f"rate({column})" in self._columns else "other"

    def _is_particle(self, stem: str) -> bool:
        """True for a particle: a vector among the outputs has no velocity."""
        return dimension_facts.base(stem) in self._facts.dimensions.positions or f"{stem}.vx" in self._columns

    def unit(self, column: str) -> str:
        """The label of its unit; empty where it is not known."""
        units = self._units
        if units is None:
            return ""
        kind, known = self.kind(column), self._facts.dimensions
        length, time = units.length.strip(), units.time.strip()
        per_time = f"{length or '1'}/{time}" if time not in ("", "1") else length
        torque = panels.force_unit(units, 2)
        of_angle = dimension_facts.base(re.sub(r"^(R\.|Q\.|rate\()|\)$", "", column)) in known.angles
        found = {
            "time": time,
            "position": length,
            "velocity": per_time,
            "coordinate": "rad" if of_angle else "",
            "rate": f"rad/{time}" if of_angle and time not in ("", "1") else "",
            "constraint force": panels.force_unit(units),
            "constraint force of a coordinate": torque if of_angle else "",
            "generalized force": torque if of_angle else "",
            "energy": "J" if torque == "N·m" else torque,
        }
        if kind == "multiplier":
            return panels.multiplier_unit(column, units, known)
        return found.get(kind, "")

    def axis(self, columns: Sequence[str]) -> str:
        """The name of an axis of some columns of one kind and unit."""
        kind, (first, *others) = self.kind(columns[0]), columns
        if not others:
            named = (
                f"{kind} {first}"
                if kind in ("multiplier", "position", "velocity", "constraint force")
                else first
            )
            return panels.with_unit(labels.shortened(named, labels.TITLE), self.unit(first))
        return panels.with_unit(PLURALS[kind], self.unit(first))


_PREFIXES = tuple(
    (re.compile(pattern, re.DOTALL), kind)
    for pattern, kind in (
        (r"t", "time"),
        (r"energy", "energy"),
        (r"err\..+", "error"),
        (r"(lambda|mu)\..+", "multiplier"),
        (r"R\..+\.[xyz]", "constraint force"),
        (r"R\..+", "constraint force of a coordinate"),
        (r"Q\..+", "generalized force"),
        (r"rate\(.+\)", "rate"),
    )
)
