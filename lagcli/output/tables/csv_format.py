"""Tables as CSV."""

from __future__ import annotations

import functools
from pathlib import Path

from lagcli.output.tables.table_format import CheckSize, Make, Provenance, ReadTable


def writer(path: Path, provenance: Provenance) -> Make:
    """See `TableFormat`."""
    from lagcli.output.tables import csv_table

    return functools.partial(csv_table.CsvWriter, delimiter=",")


def reader(path: Path, check_size: CheckSize) -> ReadTable:
    """See `TableFormat`."""
    from lagcli.output.tables import read_csv

    return read_csv.CsvTable(path, check_size)
