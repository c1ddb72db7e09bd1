"""What the writers of tables share: cells as text, files of whole blocks, and buffers of rows; the only file that
imports orjson. Doubles have the fewest digits that read back to the same double; words are few and come again."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import orjson

from lagcli.arrays import Floats
from lagcli.output.files import atomic_file
from lagcli.output.tables.table_format import TableHead, Texts

# The texts of a part, with what is needed to make them, take some 100 bytes a number.
_NUMBERS_AT_ONCE = 1 << 16
_COMMA, _LINE_END = ord(","), ord("\n")
_NULL = b"null"
_BYTES = 1 << 24  # of a buffered block: large writes, and small beside what a run takes


def csv_lines(rows: Floats) -> memoryview:
    """``rows``, shape (k, columns) with neither zero: numbers or nan between commas, a line a row."""
    # One list of all the numbers: turning every columns-th comma into a line end keeps the length of the text.
    text = bytearray(orjson.dumps(rows.ravel(), option=orjson.OPT_SERIALIZE_NUMPY).replace(_NULL, b"nan"))
    letters = np.frombuffer(text, np.uint8)
    ends = np.flatnonzero(letters == _COMMA)[rows.shape[1] - 1 :: rows.shape[1]]
    letters[ends] = letters[-1] = _LINE_END
    return memoryview(text)[1:]


def json_lines(rows: Floats) -> bytes:
    """``rows``, shape (k, columns), as JSON lists, a line each, with a comma between them; nan is null."""
    text = orjson.dumps(np.ascontiguousarray(rows), option=orjson.OPT_SERIALIZE_NUMPY)
    return text[1:-1].replace(b"],[", b"],\n[")


def parsed_json(text: bytes) -> Any:
    """The value of a text of JSON. Raises ValueError, also for numbers beyond all doubles and too deep lists."""
    return orjson.loads(text)


def spliced(
    lines: Sequence[bytes], at: Sequence[int], texts: Texts, written: Callable[[str], bytes], separator: bytes
) -> list[bytes]:
    """Lines of numbers with texts (columns of text, lines) put in as they are written: they are the columns `at`."""
    known = {text: written(text) for column in texts for text in set(column)}
    before = at[-1] + 1 - len(at)  # numbers before the last text
    found = []
    for line, *cells in zip(lines, *([known[text] for text in column] for column in texts), strict=True):
        words = line.split(separator, before)
        for index, cell in zip(at, cells, strict=True):
            words.insert(index, cell)
        found.append(separator.join(words))
    return found


class BlockFile:
    """``head``, then bytes appended block by block; of an interrupted block nothing stays in the file. There is no
    buffer: to close it writes nothing, and cannot wait for the reader of a pipe."""

    def __init__(self, path: Path, head: bytes) -> None:
        self._file = open(path, "wb", buffering=0)  # noqa: SIM115 (closed by close or abandon)
        self._end = 0
        self._torn = False
        with atomic_file.undone_by(self._file.close):
            self.append(head)

    def append(self, block: bytes | memoryview) -> None:
        """Write one block after the last complete one."""
        self._restore()
        self._torn = True
        atomic_file.put(self._file, block)
        self._end += len(block)
        self._torn = False

    def close(self) -> None:
        """Cut off an incomplete block, and close."""
        try:
            self._restore()
        finally:
            self._file.close()

    def abandon(self) -> None:
        """Close a file that will not be kept."""
        self._file.close()

    def _restore(self) -> None:
        if self._torn and self._file.seekable():
            self._file.seek(self._end)
            self._file.truncate()
        self._torn = False


class BlockStream:
    """``head``, with the first block, and blocks written to a stream, which is flushed after each of them."""

    def __init__(self, stream: BinaryIO, head: bytes) -> None:
        # A run that fails before its first rows leaves the stream empty.
        self._stream, self._head = stream, head

    def append(self, block: bytes | memoryview) -> None:
        """Write the head, if it is not there, and a block."""
        self._stream.write(self._head)
        self._head = b""
        self._stream.write(block)
        self._stream.flush()

    def close(self) -> None:
        """Leave the stream open for others."""

    abandon = close


class TextWriter:
    """Writes a table whose text grows at its end, as its rows arrive; see `table_format.TableWriter`."""

    def __init__(self, file: BlockFile | BlockStream, head: TableHead, end: bytes = b"") -> None:
        self._file, self._end = file, end
        self._numbers, self._at = head.numbers, head.text_indices
        self._has_rows = False

    def _block(self, numbers: Floats, texts: Texts) -> bytes | memoryview:
        """The text of some rows."""
        raise NotImplementedError

    def write(self, rows: Floats, texts: Texts = ()) -> None:
        infinite = np.flatnonzero(np.isinf(rows).any(axis=0))
        if infinite.size:  # what has no value, as a multiplier at its pole, is nan
            raise ValueError(
                f'a table holds no infinite value, as there is in "{self._numbers[infinite[0]]}"'
            )
        step = max(1, _NUMBERS_AT_ONCE // max(1, rows.shape[1]))
        for begin in range(0, len(rows), step):
            part = slice(begin, begin + step)
            self._file.append(self._block(rows[part], [column[part] for column in texts]))
            self._has_rows = True

    def finish(self) -> None:
        self._file.append(self._end)
        self._file.close()

    def abandon(self) -> None:
        self._file.abandon()


class BufferedRows:
    """Copies of rows of ``width`` numbers and of their texts, stored as blocks of some sixteen megabytes: (width, k),
    one contiguous line a column, good until ``store`` returns, and k cells of each column of text."""

    def __init__(self, width: int, texts: int, store: Callable[[Floats, list[list[str]]], None]) -> None:
        self._block = np.empty((width, max(1, _BYTES // (8 * max(1, width)))))
        self._cells: list[list[str]] = [[] for _ in range(texts)]
        self._filled = 0
        self._store = store

    def add(self, rows: Floats, texts: Texts) -> None:
        """Take in ``rows``, shape (k, width), and their texts, and store the blocks that have become full."""
        for column, cells in zip(self._cells, texts, strict=True):
            column.extend(cells)
        taken = 0
        while taken < len(rows):
            part = rows[taken : taken + self._block.shape[1] - self._filled]
            self._block[:, self._filled : self._filled + len(part)] = part.T
            taken += len(part)
            self._filled += len(part)
            if self._filled == self._block.shape[1]:
                self.flush()

    def flush(self) -> None:
        """Store what is left as one block. The rows are forgotten first: after an interrupt rows may miss at the end of
        a partial file, but none can stand there twice."""
        filled, self._filled = self._filled, 0
        if filled:
            texts = [column[:filled] for column in self._cells]
            for column in self._cells:
                del column[:filled]
            self._store(self._block[:, :filled], texts)
