"""The words of figures and charts: labels of units, what a column is, and names that tell several tables apart."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from pathlib import PurePath

from lagcli.errors import diagnostics
from lagcli.model import dimension_facts
from lagcli.model.dimension_facts import DimensionFacts
from lagcli.model.model import Units
from lagcli.output.tables.provenance import TableFacts

# Letters; the tests draw longer ones. A title of so many fills about three lines, a name about one, and a unit leaves
# the axis it labels its room.
TITLE, NAME, UNIT = 300, 100, 40
_RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹"
# Kinds in which what is 1e-12 of the largest column is rounding: they have one unit and come from the same sums.
COMPARABLE = ("position", "velocity", "multiplier", "constraint force")
# Each kind with its plural, and the names that tell it, where they do.
_KINDS = {
    "time": ("t", r"t"),
    "energy": ("energy", r"energy"),
    "error": ("errors", r"err\..+"),
    "multiplier": ("multipliers λ", r"(lambda|mu)\..+"),
    "constraint force": ("constraint forces R", r"R\..+\.[xyz]"),
    "constraint force of a coordinate": ("constraint forces R of coordinates", r"R\..+"),
    "generalized force": ("generalized forces Q", r"Q\..+"),
    "rate": ("rates", r"rate\(.+\)"),
    "position": ("positions", ""),
    "velocity": ("velocities", ""),
    "coordinate": ("coordinates", ""),
    "other": ("", ""),
}
# Units of these are not the same for all columns of the kind.
OPEN = ("coordinate", "rate", "other", "constraint force of a coordinate", "generalized force", "error")
MOST_NAMED = 3  # parameters in one name of a table
SETTINGS = ("method", "rtol", "atol", "version")


def shortened(text: str, most: int) -> str:
    """The text with at most so many letters: its beginning and its end, with an ellipsis between them."""
    plain = diagnostics.printable(text)
    if len(plain) <= most:
        return plain
    end = most // 4
    return f"{plain[: most - end - 1]}…{plain[-end:]}"


def short_units(units: Units) -> Units:
    """The labels of units, none longer than UNIT."""
    return Units(*(shortened(label, UNIT) for label in (units.length, units.mass, units.time)))


def force_unit(units: Units, length_power: int = 1) -> str:
    """The label of mass length^p / time^2: a force for ``length_power`` 1, a force times a length for 2. Newton where
    the labels are kg, m, s; empty where all labels are empty or "1"."""
    labels = [units.mass.strip(), units.length.strip(), units.time.strip()]
    if labels == ["kg", "m", "s"]:
        more = length_power - 1
        return f"N·{_power('m', more)}" if more > 0 else f"N/{_power('m', -more)}" if more else "N"
    # A label of more than one word is one unit here, so a power must not fall on its last letter only.
    mass, length, time = (label if label.isalnum() or not label else f"({label})" for label in labels)
    above = [mass] * (mass not in ("", "1"))
    below = [_power(time, 2)] * (time not in ("", "1"))
    if length_power and length not in ("", "1"):
        (above if length_power > 0 else below).append(_power(length, abs(length_power)))
    return " ".join(above) if not below else "/".join([" ".join(above) or "1", *below])


def _power(label: str, exponent: int) -> str:
    return label if exponent == 1 else label + "".join(_RAISED[int(digit)] for digit in str(exponent))


def with_unit(quantity: str, unit: str) -> str:
    """A label such as ``t  (s)``; the quantity alone where it has no unit."""
    return f"{quantity}  ({unit})" if unit not in ("", "1") else quantity


def multiplier_unit(column: str, units: Units, known: DimensionFacts) -> str:
    """The unit of `lambda.NAME`: newton where f is a length, N·m for an angle or a number, else what its equation
    says."""
    power = known.length(column.removeprefix("lambda."))
    if power is not None and power == int(power):
        return force_unit(units, length_power=2 - int(power))
    return f"{force_unit(units, length_power=2) or '1'} / unit of fᵢ"


class ColumnTexts:
    """The words for the columns of one table."""

    def __init__(self, columns: Sequence[str], facts: TableFacts) -> None:
        self._columns, self._facts = frozenset(columns), facts
        self._units = short_units(facts.units) if facts.units is not None else None

    def kind(self, column: str) -> str:
        """The kind of a column, a key of `_KINDS`."""
        for kind, (_, pattern) in _KINDS.items():
            if pattern and re.fullmatch(pattern, column, re.DOTALL):
                return kind
        stem, _, member = column.rpartition(".")
        # A vector among the outputs is no particle, and has no velocity.
        is_position = dimension_facts.base(stem) in self._facts.dimensions.positions
        if stem and (is_position or f"{stem}.vx" in self._columns):
            if member in ("x", "y", "z"):
                return "position"
            if member in ("vx", "vy", "vz"):
                return "velocity"
        return "coordinate" if f"rate({column})" in self._columns else "other"

    def unit(self, column: str) -> str:
        """The label of its unit; empty where it is not known."""
        units = self._units
        if units is None:
            return ""
        kind, known = self.kind(column), self._facts.dimensions
        if kind == "multiplier":
            return multiplier_unit(column, units, known)
        length, time = units.length.strip(), units.time.strip()
        per_time = f"{length or '1'}/{time}" if time not in ("", "1") else length
        torque = force_unit(units, 2)
        of_angle = dimension_facts.base(re.sub(r"^(R\.|Q\.|rate\()|\)$", "", column)) in known.angles
        found = {
            "time": time,
            "position": length,
            "velocity": per_time,
            "coordinate": "rad" if of_angle else "",
            "rate": f"rad/{time}" if of_angle and time not in ("", "1") else "",
            "constraint force": force_unit(units),
            "constraint force of a coordinate": torque if of_angle else "",
            "generalized force": torque if of_angle else "",
            "energy": "J" if torque == "N·m" else torque,
        }
        return found.get(kind, "")

    def axis(self, columns: Sequence[str]) -> str:
        """The name of an axis of some columns of one kind and unit."""
        kind, (first, *others) = self.kind(columns[0]), columns
        if not others:
            named = f"{kind} {first}" if kind in COMPARABLE else first
            return with_unit(shortened(named, TITLE), self.unit(first))
        return with_unit(_KINDS[kind][0], self.unit(first))


def distinguishing(paths: Sequence[str], origins: Sequence[Mapping[str, object] | None]) -> list[str]:
    """A name for each table, from the provenance where all have one and it tells them apart, else from the paths."""
    if len(paths) == 1:
        return [""]
    known = [origin for origin in origins if origin is not None]
    if len(known) == len(paths):
        tables = [_mapping(origin.get("parameters")) for origin in known]
        models = {_text(origin.get("sha256")) for origin in known}
        if len(models) == 1 and models != {"none"}:  # of one model those that were set: others follow
            was_set = {name for origin in known for name in _mapping(origin.get("set"))}
            tables = [{name: value for name, value in one.items() if name in was_set} for one in tables]
        for table, origin in zip(tables, known, strict=True):  # a space: no parameter has such a name
            table |= {f" {name}": origin.get(name) for name in SETTINGS}
        # `L = 1.5, m = 2` of the values that differ, if they are few and tell all tables apart
        every = dict.fromkeys(name for table in tables for name in table)
        differing = [name for name in every if len({_text(table.get(name)) for table in tables}) > 1]
        if 1 <= len(differing) <= MOST_NAMED:
            named = [[f"{name.strip()} = {_text(table.get(name))}" for name in differing] for table in tables]
            texts = list(map(", ".join, named))
            if len(set(texts)) == len(texts):
                return texts
    names = _by_paths(paths)
    return [
        name if name and names.count(name) == 1 else f"{name} ({number})" if name else f"run {number}"
        for number, name in enumerate(names, 1)
    ]


def _mapping(value: object) -> dict[str, object]:
    return {str(name): one for name, one in value.items()} if isinstance(value, Mapping) else {}


def _text(value: object) -> str:
    if value is None:
        return "none"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_text, value))}]"
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def _by_paths(paths: Sequence[str]) -> list[str]:
    """The parts of paths that differ: folders first, then words of the names."""
    parts = [PurePath(path).parts for path in paths]
    cut = _without_common([list(each) for each in parts])
    if {len(each) for each in cut} != {1}:
        return ["/".join(each) or "/".join(whole) for each, whole in zip(cut, parts, strict=True)]
    names = [PurePath(each[0]) for each in cut]
    # A dot may be that of a number, and a hyphen its sign, or stand between a quantity and its value.
    is_alike = len({name.suffix for name in names}) == 1
    plain = [name.stem if is_alike else name.name for name in names]
    words = [re.findall(r"[^_ ]+|[_ ]", name) for name in plain]
    short = ["".join(each).strip("_ ") for each in _without_common(words)]
    return short if all(short) else plain


def _without_common(lists: list[list[str]]) -> list[list[str]]:
    """The lists without what all begin with and all end with."""

    def common(several: list[list[str]]) -> int:
        first = zip(*several, strict=False)
        return sum(1 for _ in itertools.takewhile(lambda items: len(set(items)) == 1, first))

    head = common(lists)
    tails = [each[head:] for each in lists]
    tail = common([each[::-1] for each in tails])
    return [each[: len(each) - tail] for each in tails]
