"""Tables as lines with tabs: CSV but for the separator."""

from __future__ import annotations

import functools
from pathlib import Path

from lagcli.output.tables import csv_format
from lagcli.output.tables.table_format import CheckSize, Make, Provenance, ReadTable


def writer(path: Path, provenance: Provenance) -> Make:
    """See `TableFormat`."""
    return functools.partial(csv_format.CsvWriter, delimiter="\t")


def reader(path: Path, check_size: CheckSize) -> ReadTable:
    """See `TableFormat`."""
    return TsvTable(path, check_size)


class TsvTable(csv_format.CsvTable):
    """An open file of lines with tabs."""

    separator, called, others = "\t", "tabs", "[;,]"
