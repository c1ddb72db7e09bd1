"""Tables read back: what the writers of this room wrote, or a program that writes the same formats."""

import csv
import json
import os
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lagcli.export import endings
from lagcli.export.tables import needing_pyarrow


class UnreadableTable(ValueError):
    """The file is no table in the format that its ending names."""


def read(path: str | os.PathLike[str]) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    """The columns of a table and its rows (T, columns); what has no value is nan.

    Raises ``endings.UnknownFormat``, ``MissingExtra``, ``UnreadableTable``, OSError.
    """
    target = Path(path)
    fmt = endings.of(target, endings.TABLES)
    try:
        columns, rows = {"csv": _csv, "json": _json, "npz": _npz, "parquet": _parquet}[fmt](target)
    except (ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
        if isinstance(error, UnreadableTable):
            raise
        raise UnreadableTable(f"{path} is no table in the format .{fmt}: {error}") from None
    if len(set(columns)) < len(columns):
        raise UnreadableTable(f"{path} has two columns of one name")
    return columns, rows


def _csv(path: Path) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    with path.open(encoding="utf-8", newline="") as file:
        lines = csv.reader(file)
        columns = tuple(next(lines, ()))
        rows = [[float(cell) if cell else np.nan for cell in line] for line in lines]
    return columns, _shaped(path, columns, rows)


def _json(path: Path) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    found = json.loads(path.read_text(encoding="utf-8"))
    columns = tuple(str(name) for name in found["columns"])
    rows = [[np.nan if cell is None else float(cell) for cell in line] for line in found["rows"]]
    return columns, _shaped(path, columns, rows)


def _shaped(path: Path, columns: tuple[str, ...], rows: list[list[float]]) -> NDArray[np.float64]:
    for number, line in enumerate(rows, 1):
        if len(line) != len(columns):
            raise UnreadableTable(f"{path}: row {number} has {len(line)} entries for {len(columns)} columns")
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(columns))


def _npz(path: Path) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    with np.load(path, allow_pickle=False) as archive:
        columns = tuple(archive.files)
        values = [np.asarray(archive[name], dtype=np.float64) for name in columns]
    if any(column.ndim != 1 or column.size != values[0].size for column in values):
        raise UnreadableTable(f"{path}: its arrays are no columns of one length")
    return columns, np.stack(values, axis=1) if values else np.zeros((0, 0))


def _parquet(path: Path) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    with needing_pyarrow(path):
        import pyarrow.parquet
    table = pyarrow.parquet.read_table(str(path))
    columns = tuple(table.column_names)
    values = [np.asarray(table[name].to_numpy(), dtype=np.float64) for name in columns]
    return columns, np.stack(values, axis=1) if values else np.zeros((0, 0))
