"""Tables as NPZ: a zip archive with one array per column name, for ``numpy.load(..., allow_pickle=False)``.

A column can only be written when all its rows are there, so blocks of them wait in a temporary file (in memory while
they are few). ``numpy.savez`` holds the whole table, and cannot write a column called ``file``. The comment of the
archive holds the provenance: another array would look like a column.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
import json
import re
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from lagcli.arrays import Floats
from lagcli.output.tables import cell_text, table_format
from lagcli.output.tables.table_format import SHOWN, CheckSize, TableFormat, TableHead, Texts, bad

_BYTES_IN_MEMORY = 1 << 23  # of rows that wait, before a file is made for them
_MOST_COMMENT = 65_535  # bytes; the format of zip archives has no room for more
MOST_HEADER = 4096  # bytes of the header of an array
NUMBERS, TEXTS = "[<>|=]?[fiu][1248]", r"[<>=]U\d{1,4}"


class NpzWriter:
    """Writes a table to ``path`` once all its rows have arrived."""

    def __init__(self, path: Path, head: TableHead) -> None:
        self._comment = b""
        if head.provenance is not None:
            # As JSON; what makes it too long, thousands of parameters, is null then.
            entries = dict(head.provenance)
            while len(text := json.dumps(entries, allow_nan=False).encode()) > _MOST_COMMENT:
                entries[max(entries, key=lambda name: len(json.dumps(entries[name])))] = None
            self._comment = text
        self._path, self._head, self._width = path, head, len(head.numbers)
        self._buffer = cell_text.BufferedRows(self._width, len(head.text_indices), self._store)
        self._spool = tempfile.SpooledTemporaryFile(  # noqa: SIM115 (closed by finish or abandon)
            max_size=_BYTES_IN_MEMORY, dir=str(path.parent)
        )
        self._blocks: list[tuple[int, list[list[str]]]] = []  # rows of each, and their texts

    def write(self, rows: Floats, texts: Texts = ()) -> None:
        self._buffer.add(rows, texts)

    def finish(self) -> None:
        """Write the archive; its bytes depend on the table alone."""
        self._buffer.flush()
        with self._spool, zipfile.ZipFile(self._path, "w") as archive:
            archive.comment = self._comment
            numbers, texts = itertools.count(), itertools.count()
            for name in self._head.columns:
                # A fixed date, so that equal tables give equal files.
                member = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
                with archive.open(member, "w", force_zip64=True) as file:
                    if name in self._head.texts:
                        k = next(texts)
                        cells = [cell for _, columns in self._blocks for cell in columns[k]]
                        array = np.array(cells, dtype="<U")
                        np.lib.format.write_array(file, array, version=(1, 0), allow_pickle=False)
                        continue
                    header = {"descr": "<f8", "fortran_order": False, "shape": (self._rows,)}
                    np.lib.format.write_array_header_1_0(file, header)
                    index, first = next(numbers), 0  # byte of the block in the spool
                    for length, _ in self._blocks:
                        self._spool.seek(first + 8 * length * index)
                        file.write(self._spool.read(8 * length))
                        first += 8 * length * self._width

    def abandon(self) -> None:
        """Remove the temporary file."""
        self._spool.close()

    @property
    def _rows(self) -> int:
        return sum(length for length, _ in self._blocks)

    def _store(self, block: Floats, texts: list[list[str]]) -> None:
        # Sought, not merely appended: an interrupted block must be overwritten by the next.
        self._spool.seek(8 * self._width * self._rows)
        self._spool.write(np.ascontiguousarray(block, "<f8").data)
        self._blocks.append((block.shape[1], texts))


class NpzTable:
    """A zip archive of arrays, stored or deflated; of their headers only the plainest are taken."""

    def __init__(self, path: Path, check_size: CheckSize) -> None:
        self._path, self._check_size = path, check_size
        with self._archive() as archive:
            self._members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
            self.columns = tuple(info.filename.removesuffix(".npy") for info in archive.infolist())
            self.provenance = table_format.parsed_provenance(archive.comment)

    @functools.cached_property
    def length(self) -> int | None:
        with self._archive() as archive:
            try:
                return self._header(archive, self.columns[0])[1] if self.columns else 0
            except table_format.UnreadableTable:
                return None

    def take(self, names: Sequence[str]) -> Floats:
        with self._archive() as archive:
            headers = [self._header(archive, name) for name in names]
            lengths = {length for _, length, _ in headers}
            if len(lengths) > 1:
                raise bad(self._path, f"its arrays have different lengths: {min(lengths)}, {max(lengths)}")
            length = lengths.pop() if lengths else 0
            self._check_size(self._path, length, len(names))
            found = np.empty((length, len(names)))
            for k, (kind, _, start) in enumerate(headers):
                data = self._bytes(archive, names[k], start, length * kind.itemsize)
                found[:, k] = np.frombuffer(data, kind)
        return found

    def words(self, name: str) -> list[str]:
        with self._archive() as archive:
            kind, length, start = self._header(archive, name, is_text=True)
            self._check_size(self._path, length, 1 + kind.itemsize // 8)
            data = self._bytes(archive, name, start, length * kind.itemsize)
        try:
            return [str(cell) for cell in np.frombuffer(data, kind)]
        except ValueError as error:  # a code that is no letter
            raise bad(self._path, f"`{name}`: {error}") from None

    @contextlib.contextmanager
    def _archive(self) -> Iterator[zipfile.ZipFile]:
        with self._path.open("rb") as file:
            try:
                archive = zipfile.ZipFile(file)
            except (zipfile.BadZipFile, NotImplementedError, ValueError, OSError) as error:
                # The file is open: an OSError is a position that the archive names and that is not there.
                raise bad(self._path, error) from None
            with archive:
                yield archive

    def _header(
        self, archive: zipfile.ZipFile, name: str, is_text: bool = False
    ) -> tuple[np.dtype[np.generic], int, int]:
        """Type and length of an array, and where its cells begin; without running what its header says."""
        info = self._members[name]
        if info.flag_bits & 1:
            raise bad(self._path, f"`{name}` is encrypted")
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise bad(self._path, f"`{name}` is compressed by a method that NumPy does not write")
        head = self._bytes(archive, name, 0, min(MOST_HEADER, info.file_size))
        if head[:6] != b"\x93NUMPY" or len(head) < 12:
            raise bad(self._path, f"`{name}` is no array")
        first = 10 if head[6] == 1 else 12
        start = first + int.from_bytes(head[8:first], "little")
        text = head[first:start].decode("latin-1")
        what = "text" if is_text else "real numbers"
        kind = re.search(rf"'descr': *'({TEXTS if is_text else NUMBERS})'", text)
        shape = re.search(r"'shape': *\((\d{1,15}),?\)", text)
        if kind is None or shape is None or start > MOST_HEADER:
            raise bad(self._path, f"`{name}` is no column of {what}: {text[:SHOWN].strip()}")
        if kind[1].endswith("f1") and not is_text:  # a number of one byte has no fractions
            raise bad(self._path, f"`{name}` is no column of {what}: {kind[1]}")
        plain = np.dtype(kind[1])
        if start + int(shape[1]) * plain.itemsize != info.file_size:
            raise bad(self._path, f"`{name}` is said to have {shape[1]} numbers, which its size denies")
        return plain, int(shape[1]), start

    def _bytes(self, archive: zipfile.ZipFile, name: str, start: int, count: int) -> bytes:
        try:
            with archive.open(self._members[name]) as member:
                member.read(start)
                data = member.read(count)
        except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, OSError) as error:
            raise bad(self._path, f"`{name}`: {error or 'it ends too early'}") from None
        if len(data) != count:
            raise bad(self._path, f"`{name}` ends too early")
        return data


NPZ = TableFormat(NpzWriter, NpzTable)
