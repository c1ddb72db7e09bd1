"""Tables read back from NPZ archives."""

from __future__ import annotations

import functools
import re
import zipfile
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from lagcli.output.tables.unreadable import SHOWN, UnreadableTable, bad, provenance

MOST_HEADER = 4096  # bytes of the header of an array
NUMBERS, TEXTS = "[<>|=]?[fiu][1248]", r"[<>=]U\d{1,4}"

Floats = NDArray[np.float64]


class NpzTable:
    """A zip archive of arrays, stored or deflated; of their headers only the plainest are taken."""

    def __init__(self, path: Path, check_size: Callable[[Path, int, int], None]) -> None:
        self._path, self._check_size = path, check_size
        with path.open("rb") as file, self._archive(file) as archive:
            self._members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
            self.columns = tuple(info.filename.removesuffix(".npy") for info in archive.infolist())
            self.provenance = provenance(archive.comment)

    @functools.cached_property
    def length(self) -> int | None:
        """See `ReadTable`: that of the first column, where it holds numbers."""
        with self._path.open("rb") as file, self._archive(file) as archive:
            try:
                return self._header(archive, self.columns[0])[1] if self.columns else 0
            except UnreadableTable:
                return None

    def take(self, names: Sequence[str]) -> Floats:
        """See `ReadTable`."""
        with self._path.open("rb") as file, self._archive(file) as archive:
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
        """See `ReadTable`."""
        with self._path.open("rb") as file, self._archive(file) as archive:
            kind, length, start = self._header(archive, name, is_text=True)
            self._check_size(self._path, length, 1 + kind.itemsize // 8)
            data = self._bytes(archive, name, start, length * kind.itemsize)
        try:
            return [str(cell) for cell in np.frombuffer(data, kind)]
        except ValueError as error:  # a code that is no letter
            raise bad(self._path, f"`{name}`: {error}") from None

    def _archive(self, file: BinaryIO) -> zipfile.ZipFile:
        try:
            return zipfile.ZipFile(file)
        except (zipfile.BadZipFile, NotImplementedError, ValueError, OSError) as error:
            # The file is open: an OSError is a place that the archive names and that is not there.
            raise bad(self._path, error) from None

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
        except (
            zipfile.BadZipFile,
            zlib.error,
            EOFError,
            NotImplementedError,
            RuntimeError,
            OSError,
        ) as error:
            raise bad(self._path, f"`{name}`: {error or 'it ends too early'}") from None
        if len(data) != count:
            raise bad(self._path, f"`{name}` ends too early")
        return data
