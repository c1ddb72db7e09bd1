"""The quick reader of CSV gives what the one that goes cell by cell gives, or leaves the file to it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lagcli.output.tables import csv_format, table_format
from lagcli.output.tables.table_format import UnreadableTable

CELLS = (
    *["1", "-2e-3", "nan", "inf", "-Infinity", "1e400", "5e-324", "+3", ".5", "5.", " 1", "1 ", "0.1"],
    *["", "1_0", "0x10", "0x1p3", "1d5", "1.0L", "#1", "1#", "1,2", "1j", "true", "-", "e1", "\x00"],
    *["١", "∞", "1\u00a0", "\u20031", '"1"', '"', "1\r2"],
)
PLACES = (
    "a,b\n{},2\n3,4\n",
    "a,b\n1,{}\n3,4",
    "a,b\r\n1,{}\r\n3,4\r\n",
    "a,b\n1,2\n\n{},4\n",
    "a,b\n1\n{},4,5\n",
)


def cell_by_cell(path: Path, monkeypatch: pytest.MonkeyPatch) -> object:
    with monkeypatch.context() as patch:
        patch.setattr(csv_format, "plain_count", lambda *_: None)
        return taken(path)


def taken(path: Path) -> object:
    try:
        return str(table_format.opened(path).take(["a", "b"]).tolist())
    except UnreadableTable as error:
        return str(error)


@pytest.mark.parametrize("more", ["", ",1,2,3,4,5,6"])
@pytest.mark.parametrize("cell", [*CELLS, "01", "null", "[1]", "-0.0", "9007199254740993", "1" * 400])
def test_both_readers_say_the_same(
    cell: str, more: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Few columns are cut out, many are parsed together."""
    path = tmp_path / "table.csv"
    for place in PLACES:
        header, _, body = place.format(cell).partition("\n")
        text = header.replace("b", "b" + more) + "\n" + body.replace("4", "4" + more).replace("2", "2" + more)
        path.write_text(text, encoding="utf-8", newline="")
        assert taken(path) == cell_by_cell(path, monkeypatch), place


def test_random_numbers_come_back_to_the_bit(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    values = rng.integers(0, 2**64, (2000, 3), dtype=np.uint64).view(np.float64)
    values[~np.isfinite(values)] = 0.0
    path = tmp_path / "table.csv"
    text = "".join(",".join(map(repr, row)) + "\n" for row in values.tolist())
    path.write_text("a,größe,c\n" + text, encoding="utf-8-sig")
    count = csv_format.plain_count(path, ",", 3)
    assert count == 2000
    for places in ([2, 0], [2, 0, 1], [1]):
        found = csv_format.plain_numbers(path, ",", 3, places, count)
        assert found is not None
        assert np.array_equal(found, values[:, places])


@pytest.mark.parametrize("text", ["a,b\n", "a,b", "", 'a,"b"\n1,2\n', "a,b\n1,2,3\n4\n"])
def test_files_that_are_not_plain_are_left(text: str, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text(text, encoding="utf-8")
    count = csv_format.plain_count(path, ",", 2)
    assert not count or csv_format.plain_numbers(path, ",", 2, [0], count) is None
