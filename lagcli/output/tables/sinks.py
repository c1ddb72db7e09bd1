"""The sinks of the rows of a run: ``open_sink`` chooses the format and gives a sink for them."""

import abc
import contextlib
import errno
import io
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self, TextIO, cast

import numpy as np
from numpy.typing import NDArray

from lagcli.output.files import atomic_file, formats
from lagcli.output.tables import cell_text, csv_format, table_format
from lagcli.output.tables.table_format import Make, TableHead


class Sink(abc.ABC):
    """Takes the rows of one table block by block; exactly one of commit, keep_partial and discard ends it.

    As a context manager it is discarded on an exception and committed otherwise, unless it has been ended
    before. All methods let OSError pass; a commit or keep_partial that fails has discarded.
    """

    def __init__(self, head: TableHead) -> None:
        self._width, self._texts = len(head.numbers), len(head.texts)
        self._ended = False
        self._rows = 0

    @abc.abstractmethod
    def write(self, rows: NDArray[np.float64], texts: cell_text.Texts = ()) -> None:
        """Append ``rows``, shape (k, columns of numbers), and the cells of each column of text; raises ValueError for
        another shape or an ended sink."""

    @property
    @abc.abstractmethod
    def is_file(self) -> bool:
        """True if the rows go into a file that is moved into place, and not to a reader who may keep them waiting."""

    def finish(self, planned: int | None = None) -> None:
        """The table is complete, and a file of it still aside; ``planned``: the number of its rows, where it is known:
        OSError where others were written."""
        self._must_be_open()
        if planned is not None and planned != self._rows:
            raise OSError(errno.EIO, f"{self._rows} rows were written of {planned}")

    @abc.abstractmethod
    def commit(self, durably: bool = False, planned: int | None = None) -> None:
        """Finish the table, and move it into place; ``durably``: return when it is on the disk."""

    @abc.abstractmethod
    def keep_partial(self) -> Path | None:
        """The run broke off: keep the rows so far in FILE.partial and return that path; None for a stream."""

    @abc.abstractmethod
    def discard(self) -> None:
        """Leave nothing behind; no effect on an ended sink."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._ended:
            return
        if kind is None:
            self.commit()
        else:
            self.discard()

    def _must_be_open(self) -> None:
        if self._ended:
            raise ValueError("the sink has ended")

    def _checked(self, rows: NDArray[np.float64], texts: cell_text.Texts) -> NDArray[np.float64]:
        self._must_be_open()
        if rows.ndim != 2 or rows.shape[1] != self._width:
            raise ValueError(f"rows of shape {rows.shape} for {self._width} columns")
        if len(texts) != self._texts or any(len(cells) != len(rows) for cells in texts):
            raise ValueError(f"texts that do not fit {len(rows)} rows of {self._texts} columns of text")
        self._rows += len(rows)
        return rows.astype(np.float64, copy=False)


def open_sink(
    target: str | os.PathLike[str] | BinaryIO | TextIO,
    columns: Sequence[str],
    fmt: str | None = None,
    provenance: Mapping[str, object] | None = None,
    texts: Sequence[str] = (),
) -> Sink:
    """A sink for the table with the names ``columns``; those in ``texts`` hold text, the others numbers.

    ``target`` is a path, whose ending (or ``fmt``, one of ``formats.TABLES``) picks the format, or an open
    stream, which gets CSV, flushed after every block. A file is written aside and moved into place.
    ``provenance``: where the table comes from, for the formats that have a place for it (all but CSV): the key
    ``provenance`` of JSON and of the metadata of a Parquet schema, the comment of the zip archive of NPZ.

    Raises ``formats.UnknownFormat``, ``table_format.MissingExtra``, ValueError for two equal names, and OSError
    where the file cannot be made. Nothing has been written then.
    """
    if len(set(columns)) < len(columns):
        raise ValueError("two columns of one name")
    head = TableHead(tuple(columns), tuple(texts), provenance)
    if not isinstance(target, str | os.PathLike):
        if fmt not in (None, "csv"):
            raise formats.UnknownFormat(f"a stream as {fmt}", ("csv",))
        return _StreamSink(target, head)
    path = Path(target)
    if fmt is None:
        fmt = formats.of(path, formats.TABLES)
    if fmt not in formats.TABLES:
        raise formats.UnknownFormat(path.name, formats.TABLES)
    return _FileSink(path, head, table_format.of(fmt).writer(path))


class _FileSink(Sink):
    def __init__(self, path: Path, head: TableHead, make: Make) -> None:
        super().__init__(head)
        self._temporary = atomic_file.PendingFile(path)
        with atomic_file.undone_by(self._temporary.discard):
            self._writer = make(self._temporary.path, head)
        self._is_finished = False

    def write(self, rows: NDArray[np.float64], texts: cell_text.Texts = ()) -> None:
        self._writer.write(self._checked(rows, texts), texts)

    @property
    def is_file(self) -> bool:
        return not self._temporary.is_in_place

    def finish(self, planned: int | None = None) -> None:
        with atomic_file.undone_by(self.discard):
            super().finish(planned)
            if not self._is_finished:
                self._writer.finish()
                self._is_finished = True

    def commit(self, durably: bool = False, planned: int | None = None) -> None:
        self.finish(planned)
        with self._ending():
            self._temporary.commit(durably)

    def keep_partial(self) -> Path:
        self.finish()
        with self._ending():
            return self._temporary.keep_partial()

    def discard(self) -> None:
        if self._ended:
            return
        self._ended = True
        try:
            # What is thrown away need not be complete, and the error that led here must not be hidden.
            with contextlib.suppress(OSError):
                self._writer.abandon()
        finally:
            self._temporary.discard()

    @contextlib.contextmanager
    def _ending(self) -> Iterator[None]:
        """Let the file be moved, and leave nothing behind where that fails."""
        with atomic_file.undone_by(self.discard):
            yield
        self._ended = True


class _StreamSink(Sink):
    def __init__(self, stream: BinaryIO | TextIO, head: TableHead) -> None:
        super().__init__(head)
        self._table, self._numbers = csv_format.CsvText(head), head.numbers
        # Written with the first rows, so that a run which fails before them leaves the stream empty.
        self._header = self._table.header()
        self._text: TextIO | None = None
        if isinstance(stream, io.TextIOBase):
            # The bytes below the text, where there are any: a text layer may turn "\n" into "\r\n".
            stream.flush()
            self._bytes: BinaryIO | None = getattr(stream, "buffer", None)
            self._text = cast(TextIO, stream)
        else:
            self._bytes = cast(BinaryIO, stream)

    def write(self, rows: NDArray[np.float64], texts: cell_text.Texts = ()) -> None:
        rows = self._checked(rows, texts)
        cell_text.require_no_infinity(rows, self._numbers)
        self._put(self._header)
        self._header = b""
        for part in self._table.lines(rows, texts):
            self._put(part)
        self._flush()

    is_file = False

    def commit(self, durably: bool = False, planned: int | None = None) -> None:
        self._must_be_open()
        self._put(self._header)
        self._flush()
        self.finish(planned)
        self._ended = True

    def keep_partial(self) -> None:
        self.commit()

    def discard(self) -> None:
        self._ended = True

    def _put(self, data: bytes | memoryview) -> None:
        if self._bytes is not None:
            self._bytes.write(data)
        elif self._text is not None:
            self._text.write(bytes(data).decode())

    def _flush(self) -> None:
        stream = self._bytes if self._bytes is not None else self._text
        if stream is not None:
            stream.flush()
