"""The facts behind the columns of a table: the title and the units of its model, and what is zero to rounding."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from lagcli.model import dimension_facts
from lagcli.model.dimension_facts import DimensionFacts
from lagcli.model.model import Model, Units


@dataclasses.dataclass(frozen=True, slots=True)
class TableFacts:
    """The known facts: units is None where the labels of the model are not known; zeros: columns that are zero to
    rounding, in a run whose forces are known."""

    title: str = ""
    units: Units | None = None
    dimensions: DimensionFacts = dimension_facts.NOTHING
    zeros: frozenset[str] = frozenset()
    is_judged: bool = False

    def as_json(self) -> dict[str, object]:
        """The entries `title`, `units` and `dimensions` of a provenance."""
        units = self.units or Units()
        return {
            "title": self.title,
            "units": dataclasses.asdict(units),
            "dimensions": {
                "lengths": self.dimensions.lengths,
                "angles": sorted(self.dimensions.angles),
                "positions": sorted(self.dimensions.positions),
            },
        }


NOTHING = TableFacts()


def of_model(model: Model) -> TableFacts:
    """The facts that the text of a model tells."""
    return TableFacts(model.title, model.units, dimension_facts.of(model))


def of_provenance(origin: Mapping[str, object] | None) -> TableFacts:
    """The facts that a provenance tells; entries of any other form, a stranger's, tell nothing."""
    if origin is None:
        return NOTHING
    title, labels, told = origin.get("title"), origin.get("units"), origin.get("dimensions")
    units = None
    if isinstance(labels, Mapping):
        found = {name: labels.get(name) for name in ("length", "mass", "time")}
        texts = {name: label for name, label in found.items() if isinstance(label, str)}
        units = Units(**texts) if len(texts) == len(found) else None
    dimensions = _dimensions(told) if isinstance(told, Mapping) else dimension_facts.NOTHING
    return TableFacts(title if isinstance(title, str) else "", units, dimensions)


def _dimensions(told: Mapping[str, object]) -> DimensionFacts:
    lengths = told.get("lengths")
    powers = {
        name: float(power)
        for name, power in (lengths.items() if isinstance(lengths, Mapping) else ())
        if isinstance(name, str) and isinstance(power, (int, float)) and abs(power) <= MOST_POWER
    }
    return DimensionFacts(powers, _names(told.get("angles")), _names(told.get("positions")))


MOST_POWER = 99  # of a length: more is no dimension


def _names(told: object) -> frozenset[str]:
    return (
        frozenset(name for name in told if isinstance(name, str)) if isinstance(told, list) else frozenset()
    )
