"""Tables as arrays of NumPy."""

from __future__ import annotations

import functools
from pathlib import Path

from lagcli.output.tables.table_format import CheckSize, Make, Provenance, ReadTable


def writer(path: Path, provenance: Provenance) -> Make:
    """See `TableFormat`."""
    from lagcli.output.tables import npz_table

    return functools.partial(npz_table.NpzWriter, provenance=provenance)


def reader(path: Path, check_size: CheckSize) -> ReadTable:
    """See `TableFormat`."""
    from lagcli.output.tables import read_npz

    return read_npz.NpzTable(path, check_size)
