"""A format of tables is one file and one line: what a further one needs, and that the rest follows."""

import json
import sys
import types
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from lagcli.arrays import Floats
from lagcli.output.files import formats
from lagcli.output.tables import sinks, table_format


class _Lines:
    """A list of JSON a line, the names first."""

    provenance = None

    def __init__(self, path: Path, check_size: table_format.CheckSize) -> None:
        names, *self._rows = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
        self.columns, self.length = tuple(names), len(self._rows)
        check_size(path, self.length, len(names))

    def take(self, names: Sequence[str]) -> Floats:
        return np.array(self._rows)[:, table_format.column_indices(self.columns, names)]


class _LineWriter:
    def __init__(self, path: Path, head: table_format.TableHead) -> None:
        self._file = path.open("w", encoding="utf-8")
        self._file.write(json.dumps(list(head.columns)) + "\n")

    def write(self, rows: Floats, texts: object = ()) -> None:
        self._file.writelines(json.dumps(row) + "\n" for row in rows.tolist())

    def finish(self) -> None:
        self._file.close()

    abandon = finish


def test_a_further_format_is_written_and_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = types.ModuleType("lagcli.output.tables.lines_format")
    module.JSONL = table_format.TableFormat(_LineWriter, _Lines)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setitem(formats.FORMATS, "jsonl", formats.FileFormat("lines_format"))
    monkeypatch.setattr(formats, "TABLES", tuple(sorted(formats.FORMATS)))
    rows = np.array([[0.0, 1.5], [0.1, -2.0]])
    path = tmp_path / "table.jsonl"
    with sinks.open_sink(path, ["t", "x"]) as sink:
        sink.write(rows)
    assert path.read_text(encoding="utf-8") == '["t", "x"]\n[0.0, 1.5]\n[0.1, -2.0]\n'
    columns, read = table_format.read(path)
    assert columns == ("t", "x")
    np.testing.assert_array_equal(read, rows)
    monkeypatch.setattr(table_format, "MOST_NUMBERS", 3)
    with pytest.raises(table_format.UnreadableTable, match="too large"):
        table_format.opened(path)


@pytest.mark.parametrize("ending", formats.TABLES)
def test_every_ending_has_its_file(ending: str) -> None:
    found = table_format.of(Path(f"table.{ending}"))
    assert callable(found.writer)
    assert callable(found.reader)
