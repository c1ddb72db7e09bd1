"""Tables as lines with tabs: CSV but for the separator."""

from __future__ import annotations

import functools
from pathlib import Path

from lagcli.output.tables import csv_format
from lagcli.output.tables.table_format import Make


def writer(path: Path) -> Make:
    """See `TableFormat`."""
    return functools.partial(csv_format.CsvWriter, delimiter="\t")


class TsvTable(csv_format.CsvTable):
    """An open file of lines with tabs."""

    separator, called, others = "\t", "tabs", "[;,]"


reader = TsvTable  # see `TableFormat`
