"""Tables as JSON."""

from __future__ import annotations

import functools
from pathlib import Path

from lagcli.output.tables.table_format import CheckSize, Make, Provenance, ReadTable


def writer(path: Path, provenance: Provenance) -> Make:
    """See `TableFormat`."""
    from lagcli.output.tables import json_table

    return functools.partial(json_table.JsonWriter, provenance=provenance)


def reader(path: Path, check_size: CheckSize) -> ReadTable:
    """See `TableFormat`."""
    from lagcli.output.tables import read_json

    return read_json.JsonTable(path, check_size)
