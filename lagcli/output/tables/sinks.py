"""The sinks of the rows of a run: ``open_sink`` chooses the format and gives a sink for them."""

import contextlib
import errno
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import BinaryIO, Self

import numpy as np

from lagcli.arrays import Floats
from lagcli.output.files import atomic_file
from lagcli.output.tables import csv_format, table_format
from lagcli.output.tables.table_format import TableHead, TableWriter, Texts


class Sink:
    """Takes the rows of one table block by block; one of commit, keep_partial and discard ends it.

    file: that is written aside; None for a stream. A context that has not been ended is discarded on an exception and
    committed otherwise. All methods let OSError pass; a commit or keep_partial that fails has discarded.
    """

    def __init__(self, head: TableHead, writer: TableWriter, file: atomic_file.PendingFile | None) -> None:
        self._head, self._writer, self._file = head, writer, file
        self._is_finished = self._ended = False
        self._rows = 0

    @property
    def is_file(self) -> bool:
        """True if the rows go into a file that is moved into place, and not to a reader who may keep them waiting."""
        return self._file is not None and not self._file.is_in_place

    def write(self, rows: Floats, texts: Texts = ()) -> None:
        """Append rows (k, columns of numbers) and the cells of each column of text. Raises ValueError for another
        shape."""
        self._must_be_open()
        width, columns = len(self._head.numbers), len(self._head.texts)
        if rows.ndim != 2 or rows.shape[1] != width:
            raise ValueError(f"rows of shape {rows.shape} for {width} columns")
        if len(texts) != columns or any(len(cells) != len(rows) for cells in texts):
            raise ValueError(f"texts that do not fit {len(rows)} rows of {columns} columns of text")
        self._rows += len(rows)
        self._writer.write(rows.astype(np.float64, copy=False), texts)

    def finish(self, planned: int | None = None) -> None:
        """The table is complete, and a file of it still aside; ``planned``: the number of its rows, where it is known:
        OSError where others were written."""
        with atomic_file.undone_by(self.discard):
            self._must_be_open()
            if planned is not None and planned != self._rows:
                raise OSError(errno.EIO, f"{self._rows} rows were written of {planned}")
            if not self._is_finished:
                self._writer.finish()
                self._is_finished = True

    def commit(self, durably: bool = False, planned: int | None = None) -> None:
        """Finish the table, and move it into place; ``durably``: return when it is on the disk."""
        self.finish(planned)
        with atomic_file.undone_by(self.discard):
            if self._file is not None:
                self._file.commit(durably)
        self._ended = True

    def keep_partial(self) -> Path | None:
        """The run broke off: keep the rows so far in FILE.partial and return that path; None for a stream."""
        self.finish()
        with atomic_file.undone_by(self.discard):
            partial = None if self._file is None else self._file.keep_partial()
        self._ended = True
        return partial

    def discard(self) -> None:
        """Leave nothing behind; no effect on an ended sink."""
        if self._ended:
            return
        self._ended = True
        if self._file is not None:
            try:
                # What is thrown away need not be complete, and the error that led here must not be hidden.
                with contextlib.suppress(OSError):
                    self._writer.abandon()
            finally:
                self._file.discard()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._ended:
            return
        if kind is None:
            self.commit()
        else:
            self.discard()

    def _must_be_open(self) -> None:
        if self._ended:
            raise ValueError("the sink has ended")


def open_sink(
    target: str | os.PathLike[str] | BinaryIO,
    columns: Sequence[str],
    provenance: Mapping[str, object] | None = None,
    texts: Sequence[str] = (),
) -> Sink:
    """A sink for the table with the names ``columns``; those in ``texts`` hold text, the others numbers.

    ``target`` is a path, whose ending picks the format, or an open stream, which gets CSV. ``provenance``: where the
    table comes from, for the formats that have a place for it: the key ``provenance`` of JSON and of the metadata of a
    Parquet schema, the comment of the zip archive of NPZ. Raises ``formats.UnknownFormat``, ``MissingExtra``,
    ValueError for two equal names, and OSError; nothing has been written then.
    """
    if len(set(columns)) < len(columns):
        raise ValueError("two columns of one name")
    head = TableHead(tuple(columns), tuple(texts), provenance)
    if not isinstance(target, str | os.PathLike):
        return Sink(head, csv_format.CsvWriter(target, head), None)
    path = Path(target)
    begin = table_format.of(path).writer
    file = atomic_file.PendingFile(path)
    with atomic_file.undone_by(file.discard):
        return Sink(head, begin(file.path, head), file)
