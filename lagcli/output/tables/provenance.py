"""The origin of a table: program, model and settings behind it, and what is known of its columns by that."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from lagcli import __version__
from lagcli.frozen import frozen_value
from lagcli.model import dimension_facts, settings
from lagcli.model.dimension_facts import DimensionFacts
from lagcli.model.model import Model, Units, Vector3

MOST_POWER = 99  # of a length: more is no dimension


@frozen_value
class TableFacts:
    """The facts behind the columns of a table. units: None where the labels of the model are not known; zeros: columns
    that are zero to rounding; is_judged: these have been looked for."""

    title: str = ""
    units: Units | None = None
    dimensions: DimensionFacts = dimension_facts.NOTHING
    zeros: frozenset[str] = frozenset()
    is_judged: bool = False

    def as_json(self) -> dict[str, object]:
        """The entries `title`, `units` and `dimensions` of a provenance."""
        known = self.dimensions
        return {
            "title": self.title,
            "units": dataclasses.asdict(self.units or Units()),
            "dimensions": {
                "lengths": known.lengths,
                "angles": sorted(known.angles),
                "positions": sorted(known.positions),
            },
        }


NO_FACTS = TableFacts()


def facts_of(model: Model) -> TableFacts:
    """The facts that the text of a model tells."""
    return TableFacts(model.title, model.units, dimension_facts.of(model))


def facts_from(origin: Mapping[str, object] | None) -> TableFacts:
    """The facts that a provenance tells; entries of any other form, a stranger's, tell nothing."""
    if origin is None:
        return NO_FACTS
    title, labels, entries = origin.get("title"), origin.get("units"), origin.get("dimensions")
    units = None
    if isinstance(labels, Mapping):
        found = {name: labels.get(name) for name in ("length", "mass", "time")}
        texts = {name: label for name, label in found.items() if isinstance(label, str)}
        units = Units(**texts) if len(texts) == len(found) else None
    dimensions = dimension_facts.NOTHING
    if isinstance(entries, Mapping):
        lengths = entries.get("lengths")
        powers = {
            name: float(power)
            for name, power in (lengths.items() if isinstance(lengths, Mapping) else ())
            if isinstance(name, str) and isinstance(power, (int, float)) and abs(power) <= MOST_POWER
        }
        dimensions = DimensionFacts(powers, _names(entries.get("angles")), _names(entries.get("positions")))
    return TableFacts(title if isinstance(title, str) else "", units, dimensions)


def _names(entries: object) -> frozenset[str]:
    known = entries if isinstance(entries, list) else []
    return frozenset(name for name in known if isinstance(name, str))


@frozen_value
class Provenance:
    """The origin of a table; equal runs have equal ones.

    sha256: of the bytes of the model file; parameters: all values; set: the changes of `--set` as they were given;
    atol: None where it follows the sizes of the motion.
    """

    version: str
    sha256: str
    parameters: dict[str, float | Vector3]
    set: dict[str, str]
    method: str
    rtol: float
    atol: float | None
    facts: TableFacts = NO_FACTS

    def as_json(self) -> dict[str, object]:
        """The object `provenance` of `--stats` and of tables."""
        plain = dataclasses.asdict(dataclasses.replace(self, facts=NO_FACTS))
        del plain["facts"]
        return plain | self.facts.as_json()


def of(model: Model) -> Provenance:
    """The provenance of a run of a model with its settings."""
    chosen = model.simulation
    return Provenance(
        version=__version__,
        sha256=model.sha256,
        parameters={parameter.name: parameter.value for parameter in model.parameters},
        set=dict(model.changes),
        method=settings.method_name(chosen),
        rtol=chosen.rtol,
        atol=chosen.atol,
        facts=facts_of(model),
    )
