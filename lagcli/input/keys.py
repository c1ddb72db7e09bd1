"""The keys of the model format, as `keys.json` has them: reader, hints, schema and reference page read this table."""

from __future__ import annotations

import json
import pathlib
from typing import Any

from lagcli.frozen import frozen_value
from lagcli.model import settings


@frozen_value
class Key:
    """One key: what stands under it, what it means, its default, and the keys of its entries.

    `entries` says that names of the user's stand below, each with `keys`; `short` is what an entry may also be in place
    of a mapping. `example` is a value as it is written in a file. `instead_of` are keys beside which this one may not
    stand; of the sets of keys in `one_of` at least one is complete.
    """

    name: str
    holds: str
    meaning: str
    default: str = ""
    entries: bool = False
    required: bool = False
    keys: tuple[Key, ...] = ()
    short: str = ""
    example: str = ""
    instead_of: tuple[str, ...] = ()
    one_of: tuple[tuple[str, ...], ...] = ()

    def key(self, name: str) -> Key:
        return next(key for key in self.keys if key.name == name)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(key.name for key in self.keys)


_FAMILY = (
    Key("for", "range or list of ranges", "makes the entry a family over indices", example="i = 1..N"),
    Key("if", "condition", "filters the members of a family", example="i != 2"),
)
_SIMULATION = tuple(
    Key(name, row.holds, row.meaning, row.default, example=row.example, instead_of=row.instead_of)
    for name, (_, row) in settings.table().items()
)


def _key(name: str, keys: Any = (), family: bool = False, **told: Any) -> Key:
    """A key as the file has it; the entries of a `family` have the keys of families too."""
    listed = _SIMULATION if name == "simulation" else [_key(**one) for one in keys]
    one_of, instead_of = tuple(map(tuple, told.pop("one_of", ()))), tuple(told.pop("instead_of", ()))
    of_entries = (*listed, *(_FAMILY if family else ()))
    return Key(name, keys=of_entries, one_of=one_of, instead_of=instead_of, **told)


FORMAT = _key(**json.loads(pathlib.Path(__file__).with_name("keys.json").read_text(encoding="utf-8")))
