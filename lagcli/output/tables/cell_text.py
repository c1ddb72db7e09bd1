"""The cells of a table as text: doubles in the fewest digits that read back to the same double, and words.

Words, such as kinds and names, are few and come again and again. The only file that imports orjson.
"""

import csv
import io
import json
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

Texts = Sequence[Sequence[str]]  # for each column of text, in the order of the table, its cells (k,)

# The texts of a part, with what is needed to make them, take some 100 bytes a number.
_NUMBERS_AT_ONCE = 1 << 16
_COMMA, _LINE_END = ord(","), ord("\n")
_NULL = b"null"


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
