"""Tables as JSON: ``{"columns": [...], "rows": [[...]]}``, one row a line, doubles that read back exactly.

Behind the rows ``"provenance"``, where it is known.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from lagcli.output.tables import cell_text
from lagcli.output.tables.table_format import (
    SHOWN,
    CheckSize,
    Floats,
    Make,
    TableHead,
    UnreadableTable,
    as_text,
    bad,
    column_indices,
)

MOST_JSON = 1 << 26  # bytes: a parsed file is up to 27 times as large (empty lists), 1.8 GB


def writer(path: Path) -> Make:
    """See `TableFormat`."""
    return JsonWriter


class JsonWriter:
    """Writes a table to ``path`` as its rows arrive."""

    def __init__(self, path: Path, head: TableHead) -> None:
        self._end = b"\n]}\n"
        if head.provenance is not None:
            text = json.dumps(head.provenance, ensure_ascii=False, allow_nan=False)
            self._end = f'\n], "provenance": {text}}}\n'.encode()
        self._at, self._numbers = head.text_indices, head.numbers
        self._separator = b"\n"
        names = json.dumps(list(head.columns), ensure_ascii=False)
        self._file = cell_text.BlockFile(path, f'{{"columns": {names}, "rows": ['.encode())

    def write(self, rows: Floats, texts: cell_text.Texts = ()) -> None:
        cell_text.require_no_infinity(rows, self._numbers)
        for numbers, cells in cell_text.parts(rows, texts):
            text = cell_text.json_lines(numbers)
            if self._at:
                found = text[1:-1].split(b"],\n[")
                words = cell_text.spliced(found, self._at, cell_text.as_json(cells), b",")
                text = b"[" + b"],\n[".join(words) + b"]"
            self._file.append(self._separator + text)
            self._separator = b",\n"

    def finish(self) -> None:
        self._file.append(self._end)
        self._file.close()

    def abandon(self) -> None:
        self._file.abandon()


class JsonTable:
    """An object with `columns` and `rows`. It is read as a whole, so its bytes are bounded."""

    def __init__(self, path: Path, check_size: CheckSize) -> None:
        self._path, self._check_size = path, check_size
        with path.open("rb") as file:
            text = file.read(MOST_JSON + 1)
        if len(text) > MOST_JSON:
            raise UnreadableTable(
                f"{path} is too large: a table in JSON may have {MOST_JSON >> 20} MiB (parsed, it is many times larger"
                " in memory); write .npz, .parquet or .csv"
            )
        try:
            found = cell_text.parsed_json(text.removeprefix(b"\xef\xbb\xbf"))
        except ValueError as error:
            raise bad(path, error) from None
        names = found.get("columns") if isinstance(found, dict) else None
        rows = found.get("rows") if isinstance(found, dict) else None
        if not isinstance(names, list) or not isinstance(rows, list):
            raise bad(path, "it is no object with the lists `columns` and `rows`")
        if not all(isinstance(name, str) for name in names):
            raise bad(path, "a name of a column is no text")
        self.columns, self._rows, self.length = tuple(names), rows, len(rows)
        origin = found.get("provenance")
        self.provenance = origin if isinstance(origin, dict) else None

    def take(self, names: Sequence[str]) -> Floats:
        at = column_indices(self.columns, names)
        found = np.empty((len(self._rows), len(names)))
        for number, row in self._complete_rows(len(names)):
            found[number - 1] = [self._number(row[k], number, self.columns[k]) for k in at]
        return found

    def words(self, name: str) -> list[str]:
        index = self.columns.index(name)
        return [as_text(self._path, row[index], number, name) for number, row in self._complete_rows(1)]

    def _complete_rows(self, wanted: int) -> Iterator[tuple[int, list[object]]]:
        """The rows, counted from 1, of which so many columns are wanted."""
        self._check_size(self._path, len(self._rows), wanted)
        for number, row in enumerate(self._rows, 1):
            if not isinstance(row, list) or len(row) != len(self.columns):
                many = len(row) if isinstance(row, list) else "no list of"
                raise bad(self._path, f"row {number} has {many} entries for {len(self.columns)} columns")
            yield number, row

    def _number(self, cell: object, row: int, name: str) -> float:
        if cell is None:
            return np.nan
        if isinstance(cell, bool) or not isinstance(cell, int | float):
            raise bad(
                self._path, f"row {row}: {name[:SHOWN]!r} holds {str(cell)[:SHOWN]!r}, which is no number"
            )
        return float(cell)


reader = JsonTable  # see `TableFormat`
