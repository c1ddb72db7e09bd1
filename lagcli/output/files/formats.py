"""The file endings that are written, so that a wrong one is refused before a long run; JSON for standard output."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple


class FileFormat(NamedTuple):
    """A format of tables. module: the file of `output.tables` that writes and reads it (`table_format`); separator:
    between the cells of plain text, which has no place for a provenance; needs: libraries that may be missing."""

    module: str
    separator: str = ""
    needs: tuple[str, ...] = ()


# A line each: all that is printed on formats and their endings follows from these.
FORMATS = {
    "csv": FileFormat("csv_format", ","),
    "tsv": FileFormat("csv_format", "\t"),
    "json": FileFormat("json_format"),
    "npz": FileFormat("npz_format"),
    "parquet": FileFormat("parquet_format", needs=("pyarrow",)),
}
TABLES = tuple(sorted(FORMATS))
PLAIN = {ending: fmt.separator for ending, fmt in FORMATS.items() if fmt.separator}
LISTED = ", ".join(f".{ending}" for ending in FORMATS)  # for the help of options
FIGURES = ("png", "svg", "pdf")
ANIMATIONS = ("html", "gif", "mp4")


class UnknownFormat(ValueError):
    """A file name ends in nothing that can be written."""

    def __init__(self, name: str, known: tuple[str, ...]) -> None:
        super().__init__(name, known)
        self.name, self.known = name, known

    def __str__(self) -> str:
        return f'"{self.name}": unknown format; known endings: {", ".join("." + one for one in self.known)}'


def is_table(path: str | os.PathLike[str]) -> bool:
    """True for the file of a table, by its ending; other files are models."""
    return os.path.splitext(os.fspath(path))[1].lower().removeprefix(".") in TABLES


def of(path: Path, known: tuple[str, ...]) -> str:
    """The ending of ``path``, in lower case, csv for the null device. Raises ``UnknownFormat`` where it is not
    ``known``."""
    if str(path) == os.devnull and "csv" in known:
        return "csv"
    ending = path.suffix.lower().removeprefix(".")
    if ending not in known:
        raise UnknownFormat(path.name, known)
    return ending


def json_line(value: object) -> str:
    """One line of JSON. Letters stay as they are; what a terminal would act on is escaped."""
    # Most commands print none.
    import json

    line = json.dumps(value, ensure_ascii=False, allow_nan=False)
    # Characters that are not printable stand inside of strings only, where an escape means the same.
    return "".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in line)
