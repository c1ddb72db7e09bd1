"""Tables as JSON: ``{"columns": [...], "rows": [[...]], "provenance": {...}}``, one row a line, doubles that read back
exactly; the last entry only where it is known."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from lagcli.arrays import Floats
from lagcli.output.tables import cell_text, table_format
from lagcli.output.tables.table_format import SHOWN, CheckSize, TableFormat, TableHead, Texts, bad

MOST_JSON = 1 << 26  # bytes: a parsed file is up to 27 times as large (empty lists), 1.8 GB


class JsonWriter(cell_text.TextWriter):
    """Writes a table to ``path``."""

    def __init__(self, path: Path, head: TableHead) -> None:
        end = b"\n]}\n"
        if head.provenance is not None:
            text = json.dumps(head.provenance, ensure_ascii=False, allow_nan=False)
            end = f'\n], "provenance": {text}}}\n'.encode()
        names = json.dumps(list(head.columns), ensure_ascii=False)
        file = cell_text.BlockFile(path, f'{{"columns": {names}, "rows": ['.encode())
        super().__init__(file, head, end)

    def _block(self, numbers: Floats, texts: Texts) -> bytes:
        text = cell_text.json_lines(numbers)
        if self._at:
            found = text[1:-1].split(b"],\n[")
            words = cell_text.spliced(found, self._at, texts, _quoted, b",")
            text = b"[" + b"],\n[".join(words) + b"]"
        return (b",\n" if self._has_rows else b"\n") + text


def _quoted(text: str) -> bytes:
    return json.dumps(text, ensure_ascii=False).encode()


class JsonTable(table_format.CellTable):
    """An object with `columns` and `rows`. It is read as a whole, so its bytes are bounded."""

    def __init__(self, path: Path, check_size: CheckSize) -> None:
        super().__init__(path, check_size)
        with path.open("rb") as file:
            text = file.read(MOST_JSON + 1)
        if len(text) > MOST_JSON:
            raise table_format.UnreadableTable(
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
        self.columns, self._entries = tuple(names), rows
        origin = found.get("provenance")
        self.provenance = origin if isinstance(origin, dict) else None

    @property
    def length(self) -> int:
        return len(self._entries)

    def _rows(self) -> Iterator[Sequence[object]]:
        for number, row in enumerate(self._entries, 1):
            if not isinstance(row, list):
                many = f"no list of entries for {len(self.columns)} columns"
                raise bad(self._path, f"row {number} has {many}")
            yield row

    def _number(self, cell: object, row: int, name: str) -> float:
        if cell is None:
            return np.nan
        if isinstance(cell, bool) or not isinstance(cell, int | float):
            raise bad(
                self._path, f"row {row}: {name[:SHOWN]!r} holds {str(cell)[:SHOWN]!r}, which is no number"
            )
        return float(cell)


JSON = TableFormat(JsonWriter, JsonTable)
