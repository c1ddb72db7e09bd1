"""What the writers of tables share: cells as text, files of whole blocks, and buffers of rows.

Doubles have the fewest digits that read back to the same double. Words, such as kinds and names, are few and come again
and again. The only file that imports orjson.
"""

import csv
import io
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from lagcli.output.files import atomic_file

Texts = Sequence[Sequence[str]]  # for each column of text, in the order of the table, its cells (k,)

# The texts of a part, with what is needed to make them, take some 100 bytes a number.
_NUMBERS_AT_ONCE = 1 << 16
_COMMA, _LINE_END = ord(","), ord("\n")
_NULL = b"null"
_BYTES = 1 << 24  # of a buffered block: large writes, and small beside what a run takes


def require_no_infinity(rows: NDArray[np.float64], columns: Sequence[str]) -> None:
    """ValueError with the name of the first column of ``rows``, shape (k, columns), that has an infinite value.

    What has no value, as a multiplier at its pole, is nan.
    """
    infinite = np.flatnonzero(np.isinf(rows).any(axis=0))
    if infinite.size:
        raise ValueError(f'a table holds no infinite value, as there is in "{columns[infinite[0]]}"')


def csv_lines(rows: NDArray[np.float64]) -> memoryview:
    """``rows``, shape (k, columns) with neither zero: numbers or nan between commas, a line a row."""
    # One list of all the numbers: turning every columns-th comma into a line end keeps the length of the text.
    text = bytearray(orjson.dumps(rows.ravel(), option=orjson.OPT_SERIALIZE_NUMPY).replace(_NULL, b"nan"))
    letters = np.frombuffer(text, np.uint8)
    ends = np.flatnonzero(letters == _COMMA)[rows.shape[1] - 1 :: rows.shape[1]]
    letters[ends] = letters[-1] = _LINE_END
    return memoryview(text)[1:]


def json_lines(rows: NDArray[np.float64]) -> bytes:
    """``rows``, shape (k, columns), as JSON lists, a line each, with a comma between them; nan is null."""
    text = orjson.dumps(np.ascontiguousarray(rows), option=orjson.OPT_SERIALIZE_NUMPY)
    return text[1:-1].replace(b"],[", b"],\n[")


def parsed_json(text: bytes) -> Any:
    """The value of a text of JSON. Raises ValueError, also for numbers beyond all doubles and too deep lists."""
    return orjson.loads(text)


def parts(rows: NDArray[np.float64], texts: Texts) -> Iterator[tuple[NDArray[np.float64], Texts]]:
    """Rows, shape (k, columns of numbers), and their texts in parts of bounded size."""
    step = max(1, _NUMBERS_AT_ONCE // max(1, rows.shape[1]))
    for begin in range(0, len(rows), step):
        yield rows[begin : begin + step], [column[begin : begin + step] for column in texts]


def quoted(texts: Texts, delimiter: str) -> list[list[bytes]]:
    """The cells as in CSV, quoted where they hold a delimiter, a quote or a line break."""

    def cell(text: str) -> bytes:
        line = io.StringIO()
        csv.writer(line, delimiter=delimiter, lineterminator="\n").writerow([text])
        return line.getvalue()[:-1].encode()

    known = {text: cell(text) for column in texts for text in set(column)}
    return [[known[text] for text in column] for column in texts]


def as_json(texts: Texts) -> list[list[bytes]]:
    """The cells as texts of JSON."""
    known = {text: json.dumps(text, ensure_ascii=False).encode() for column in texts for text in set(column)}
    return [[known[text] for text in column] for column in texts]


def spliced(
    lines: Sequence[bytes], at: Sequence[int], cells: Sequence[Sequence[bytes]], separator: bytes
) -> list[bytes]:
    """Lines of numbers with the cells (columns of text, lines) put in, so that they are the columns `at`."""
    before = at[-1] + 1 - len(at)  # numbers before the last text
    found = []
    for line, *texts in zip(lines, *cells, strict=True):
        words = line.split(separator, before)
        for index, text in zip(at, texts, strict=True):
            words.insert(index, text)
        found.append(separator.join(words))
    return found


class BlockFile:
    """``head``, then bytes appended block by block; of an interrupted block nothing stays in the file.

    There is no buffer above the system's: a block is in the file when `append` returns, and to close it writes
    nothing, so that it cannot wait for the reader of a pipe.
    """

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
        rest = memoryview(block)
        while rest:
            # A nearly full disk may take a part; only the next call then tells why.
            rest = rest[self._file.write(rest) :]
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


class BufferedRows:
    """Copies of the rows of a table of ``width`` columns, stored as blocks of some sixteen megabytes.

    A block has the shape (width, k), one contiguous line a column, and is good until ``store`` returns.
    """

    def __init__(self, width: int, store: Callable[[NDArray[np.float64]], None]) -> None:
        self._block = np.empty((width, max(1, _BYTES // (8 * max(1, width)))))
        self._filled = 0
        self._store = store

    def add(self, rows: NDArray[np.float64]) -> None:
        """Take in ``rows``, shape (k, width), and store the blocks that have become full."""
        taken = 0
        while taken < len(rows):
            part = rows[taken : taken + self._block.shape[1] - self._filled]
            self._block[:, self._filled : self._filled + len(part)] = part.T
            taken += len(part)
            self._filled += len(part)
            if self._filled == self._block.shape[1]:
                self.flush()

    def flush(self) -> None:
        """Store what is left as one block, if there is anything.

        The rows are forgotten first: where the receiver is interrupted, rows may miss at the end of a partial
        file, but none can stand there twice.
        """
        filled, self._filled = self._filled, 0
        if filled:
            self._store(self._block[:, :filled])
